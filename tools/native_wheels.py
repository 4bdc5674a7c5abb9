"""Builds the wheels of native/, one a platform, and installs this machine's.

.venv/bin/python tools/native_wheels.py     build this machine's wheel and install it into the development environment

A wheel serves Python 3.11 and later (abi3). All are linked by zig, which brings along what Linux, macOS and Windows need
and lets the Linux wheel run on an old glibc. Each is built once for the same sources and kept in the cache.
"""

from __future__ import annotations

import platform
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import environments
import rust
from project import CACHE, REQUIREMENTS, ROOT, ToolError, command_line, fingerprint, locked, output_of, run

WHEELS = CACHE / "native-wheels"
# In here it serves the development environment as well as the bpy wheels', whatever Python they have.
INSTALLED = environments.PACKAGES
STAMP = INSTALLED / "native-stamp"
# Neither reaches the wheel.
NOT_SOURCES = ("target", "fuzz")


@dataclass(frozen=True)
class Target:
    """What a platform's wheel is compiled for, its tag, and the libraries of the system that it may need."""

    triple: str
    tag: str
    libraries: tuple[str, ...]

    @property
    def compatibility(self) -> str:
        """The tag without the processor, as maturin wants it; other systems than Linux have no such thing."""
        return self.tag.removesuffix("_x86_64") if self.tag.startswith("manylinux") else "pypi"


# By Blender's names of the platforms.
TARGETS = {
    "linux-x64": Target(
        "x86_64-unknown-linux-gnu",
        "manylinux_2_28_x86_64",  # Blender's own minimum
        ("libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "ld-linux-x86-64.so.2"),
    ),
    "macos-arm64": Target(
        "aarch64-apple-darwin",
        "macosx_11_0_arm64",
        ("/usr/lib/libSystem.B.dylib", "/usr/lib/libiconv.2.dylib", "/usr/lib/libcharset.1.dylib"),
    ),
    "windows-x64": Target(
        "x86_64-pc-windows-gnu",
        "win_amd64",
        ("python3.dll", "kernel32.dll", "ntdll.dll", "bcryptprimitives.dll", "api-ms-win-*.dll"),
    ),
}

MACHINES = {("Linux", "x86_64"): "linux-x64", ("Darwin", "arm64"): "macos-arm64"}


def version() -> str:
    return rust.workspace_value("version")


def wheel_name(name: str) -> str:
    """The file name of a platform's wheel."""
    return f"meniscus_native-{version()}-cp311-abi3-{TARGETS[name].tag}.whl"


def own_platform() -> str:
    machine = (platform.system(), platform.machine())
    if machine not in MACHINES:
        raise ToolError(
            f"There is no native wheel for {' '.join(machine)}; where Rust is, 'pip install ./native/python' makes one."
        )
    return MACHINES[machine]


def build_all() -> list[Path]:
    """The wheels of all platforms."""
    return [build(name) for name in TARGETS]


def build(name: str) -> Path:
    """A platform's wheel, from the cache where these sources were built already."""
    folder = WHEELS / f"{name}-{sources_fingerprint()}"
    wheel = folder / wheel_name(name)
    with locked(f"native-{name}"):
        if not wheel.is_file():
            print(f"Building {wheel.name}", flush=True)
            WHEELS.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=WHEELS) as partial:
                built = compile_wheel(TARGETS[name], Path(partial))
                check(built, name)
                folder.mkdir(exist_ok=True)
                built.rename(wheel)
    return wheel


def sources_fingerprint() -> str:
    """Changes with whatever may change a wheel."""
    paths = sorted(source_files(rust.NATIVE))
    names = [str(path.relative_to(ROOT)) for path in paths]
    return fingerprint(*names, *paths, REQUIREMENTS / "native-tools.txt", Path(__file__))


def source_files(folder: Path) -> Iterator[Path]:
    top = [path for path in folder.iterdir() if path.name not in NOT_SOURCES]
    return (file for path in top for file in ([path] if path.is_file() else path.rglob("*")) if file.is_file())


def compile_wheel(target: Target, folder: Path) -> Path:
    python = environments.ensure("native-tools").python
    variables = {
        **rust.stable(target.triple),
        "CARGO_ZIGBUILD_PYTHON_PATH": str(python),  # zig is a package there
        "CARGO_ZIGBUILD_CACHE_DIR": str(CACHE / "zig"),
        "ZIG_GLOBAL_CACHE_DIR": str(CACHE / "zig"),
    }
    manifest = rust.NATIVE / "python" / "Cargo.toml"
    options = ["--release", "--locked", "--zig", "--target", target.triple, "--compatibility", target.compatibility]
    output_of([python.with_name("maturin"), "build", *options, "-m", manifest, "-o", folder], env=variables)
    return next(folder.glob("*.whl"))


def check(wheel: Path, name: str) -> None:
    """Fail where the wheel has another name than the manifest lists, or would not load on its platform."""
    import wheel_check  # lief takes a second to load, and is needed only after a build

    if wheel.name != wheel_name(name):
        raise ToolError(f"maturin made {wheel.name} and not {wheel_name(name)}: correct TARGETS in {Path(__file__).name}.")
    wheel_check.check(wheel, TARGETS[name].libraries)


def install() -> None:
    """Install this machine's wheel beside the package, unless it is there."""
    wanted = sources_fingerprint()
    if STAMP.is_file() and STAMP.read_text() == wanted:
        return
    wheel = build(own_platform())
    uv = environments.ensure_uv()
    options = ["--quiet", "--no-deps", "--reinstall", "--python", sys.executable]
    run([uv, "pip", "install", *options, "--target", INSTALLED, wheel], env=environments.uv_variables())
    STAMP.write_text(wanted)


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("native_wheels.py takes no arguments")
    install()


if __name__ == "__main__":
    command_line(main)
