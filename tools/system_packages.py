"""The system libraries that Blender as a Python module and software OpenGL need, on Debian and its relatives."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from project import ToolError, command_line, locked, run

# What the bpy wheels link against (readelf -d over all their libraries) and do not bring along.
LIBRARIES = {
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXt.so.6": "libxt6",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libGL.so.1": "libgl1",
    "libOpenGL.so.0": "libopengl0",
    "libEGL.so.1": "libegl1",
    "libgomp.so.1": "libgomp1",
}

# Software OpenGL: what Mesa's drivers are called differs between releases.
MESA_DRIVERS = ("*/dri/swrast_dri.so", "*/libgallium*.so", "*/dri/libdril_dri.so")


# The reference compiler of GLSL.
TEST_PROGRAMS = {"glslangValidator": "glslang-tools"}


def is_root_on_debian() -> bool:
    return os.geteuid() == 0 and shutil.which("apt-get") is not None


def apt_install(packages: Sequence[str]) -> None:
    """Install Debian packages; call it only where `is_root_on_debian`."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    apt_get = ["apt-get", "-o", "DPkg::Lock::Timeout=600", "-qq"]
    with locked("apt"):
        run([*apt_get, "update"], env=environment)
        run([*apt_get, "install", "-y", "--no-install-recommends", *packages], env=environment)


def ensure_libraries() -> None:
    """Install the missing system libraries as root on Debian, or name the packages in one sentence."""
    if not sys.platform.startswith("linux"):
        return
    missing = missing_packages()
    if not missing:
        return
    if is_root_on_debian():
        apt_install(missing)
    else:
        raise ToolError(f"System libraries are missing; install these Debian packages or their like: {' '.join(missing)}")


def ensure_test_programs() -> None:
    """Install what only the tests need, where that is possible; tests that miss a program say so themselves."""
    missing = [package for program, package in TEST_PROGRAMS.items() if shutil.which(program) is None]
    if missing and is_root_on_debian():
        apt_install(missing)


def missing_packages() -> list[str]:
    missing = [package for soname, package in LIBRARIES.items() if not can_load(soname)]
    folders = [folder for folder in (Path("/usr/lib"), Path("/usr/lib64")) if folder.is_dir()]
    if not any(any(folder.glob(pattern)) for folder in folders for pattern in MESA_DRIVERS):
        missing.append("libgl1-mesa-dri")
    return missing


def can_load(soname: str) -> bool:
    try:
        ctypes.CDLL(soname)
    except OSError:
        return False
    return True


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("system_packages.py takes no arguments")
    ensure_libraries()


if __name__ == "__main__":
    command_line(main)
