"""Makes the Python environments: the development environment in .venv, and in the cache one for each bpy wheel, one for
the programs that build the native module, and one for what the benchmark compares with.

    python3 tools/environments.py development | bpy-4.2 | bpy-4.5 | bpy-5.0 | bpy-5.2 | native-tools | bench-peers

Everything is installed from hash-locked lists (requirements/*.txt) by a pinned uv. Any Python 3 can run this file.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from project import CACHE, REQUIREMENTS, ROOT, ToolError, command_line, fingerprint, locked, run
from system_packages import apt_install, ensure_libraries, is_root_on_debian

STAMP = "meniscus-stamp"
# On a Python's path, this folder makes the clone import as ``meniscus``.
PACKAGES = ROOT / ".venv" / "package"
UV_FOLDER = CACHE / "uv"


@dataclass(frozen=True)
class Environment:
    """A virtual environment: where it lies, for each Python that it can be made with the list to install, and the
    package folder (see `link_package`) if it has one: an environment in the cache has none, clones may share it.
    """

    folder: Path
    locks: dict[str, str]
    package: Path | None = None

    @property
    def python(self) -> Path:
        return self.folder / "bin" / "python"


# The order of a row's Pythons is the order of preference.
ENVIRONMENTS = {
    "development": Environment(ROOT / ".venv", {"3.13": "development-py313.txt", "3.11": "development-py311.txt"}, PACKAGES),
    "bpy-4.2": Environment(CACHE / "bpy-4.2", {"3.11": "bpy-4.2.txt"}),
    "bpy-4.5": Environment(CACHE / "bpy-4.5", {"3.11": "bpy-4.5.txt"}),
    "bpy-5.0": Environment(CACHE / "bpy-5.0", {"3.11": "bpy-5.0.txt"}),
    "bpy-5.2": Environment(CACHE / "bpy-5.2", {"3.13": "bpy-5.2.txt"}),
    # maturin, zig and rustup, which build native/.
    "native-tools": Environment(CACHE / "native-tools", {"3.13": "native-tools.txt", "3.11": "native-tools.txt"}),
    "bench-peers": Environment(CACHE / "bench-peers", {"3.13": "bench-peers.txt"}),
}


def ensure(name: str) -> Environment:
    """Make the environment, or leave it as it is when its list has not changed since."""
    environment = ENVIRONMENTS[name]
    with locked(name):
        version, python = choose_python(environment.locks)
        lock = REQUIREMENTS / environment.locks[version]
        stamp = fingerprint(lock, version, str(environment.package or ""), Path(__file__))
        if stamp_of(environment) != stamp:
            print(f"Setting up {environment.folder} (Python {version})", flush=True)
            make(environment, python, lock)
            (environment.folder / STAMP).write_text(stamp)
    return environment


def stamp_of(environment: Environment) -> str:
    stamp = environment.folder / STAMP
    return stamp.read_text() if stamp.is_file() and environment.python.exists() else ""


def make(environment: Environment, python: str, lock: Path) -> None:
    """Make the environment anew. The stamp that tells it is whole is written afterwards, by the caller."""
    ensure_libraries()
    uv = ensure_uv()
    try:
        run([uv, "venv", "--quiet", "--clear", "--python", python, environment.folder], env=uv_variables())
    except ToolError as error:
        raise ToolError(
            f"Python {python} could not be used or fetched: install it (Debian's package, pyenv) and try again."
        ) from error
    install: list[str | Path] = [uv, "pip", "install", "--quiet", "--require-hashes", "--no-deps", "--only-binary", ":all:"]
    run([*install, "-r", lock, "--python", environment.python], env=uv_variables())
    if environment.package:
        link_package(environment, environment.package)


def link_package(environment: Environment, packages: Path) -> None:
    """Let the repository's root import as ``meniscus``, whatever the folder of the clone is called.

    A link serves Python and mypy alike; mypy cannot follow the import hook of an editable install, and would take the
    folder's own name for the package's.
    """
    packages.mkdir()
    (packages / "meniscus").symlink_to(ROOT, target_is_directory=True)
    site = next(environment.folder.glob("lib/python3.*/site-packages"))
    (site / "meniscus.pth").write_text(f"{packages}\n")


def choose_python(versions: Iterable[str]) -> tuple[str, str]:
    """The first of these Python versions that the machine has, with its path; else the first, for uv to fetch."""
    wanted = list(versions)
    for version in wanted:
        path = find_python(version)
        if path:
            return version, path
    return wanted[0], wanted[0]


def find_python(version: str) -> str | None:
    """A Python of that version that works; the shims of version managers are on the PATH but may not."""
    name = f"python{version}"
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    folders = [*os.environ.get("PATH", "").split(os.pathsep), "/usr/local/bin", "/usr/bin"]
    managed = sorted(pyenv.glob(f"versions/{version}.*/bin/{name}"), reverse=True)
    candidates = [*(Path(folder) / name for folder in folders if folder), *managed]
    return next((str(path) for path in candidates if is_python(path, version)), None)


def is_python(path: Path, version: str) -> bool:
    if not path.is_file():
        return False
    probe = "import ctypes, ssl, sqlite3, sys; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([str(path), "-c", probe], capture_output=True, text=True, check=False)
    return done.returncode == 0 and done.stdout.strip() == version


def ensure_uv() -> Path:
    """The pinned uv, in a virtual environment of its own."""
    lock = REQUIREMENTS / "uv.txt"
    stamp = UV_FOLDER / STAMP
    with locked("uv"):
        if not stamp.is_file() or stamp.read_text() != fingerprint(lock):
            make_plain_venv(UV_FOLDER)
            pip: list[str | Path] = [
                UV_FOLDER / "bin" / "python",
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
            ]
            run([*pip, "--require-hashes", "--only-binary", ":all:", "-r", lock])
            stamp.write_text(fingerprint(lock))
    return UV_FOLDER / "bin" / "uv"


def make_plain_venv(folder: Path) -> None:
    """A virtual environment with pip, made by whatever Python 3 there is."""
    shutil.rmtree(folder, ignore_errors=True)
    if try_venv(folder):
        return
    if not is_root_on_debian():
        raise ToolError(
            f"{sys.executable} cannot make virtual environments with pip: install the package python3-venv, and try again."
        )
    apt_install(["python3-venv"])
    if not try_venv(folder):
        raise ToolError(f"{sys.executable} cannot make virtual environments: set PYTHON to a Python 3 that can.")


def try_venv(folder: Path) -> bool:
    done = subprocess.run([sys.executable, "-m", "venv", "--clear", str(folder)], capture_output=True, check=False)
    return done.returncode == 0


def uv_variables() -> dict[str, str]:
    """The environment variables for uv: its caches beside ours, pip's settings for proxies and mirrors honoured."""
    variables = {**os.environ, "UV_CACHE_DIR": str(CACHE / "uv-cache"), "UV_PYTHON_INSTALL_DIR": str(CACHE / "python")}
    variables.setdefault("UV_HTTP_TIMEOUT", "300")
    for pip_name, uv_name in (("PIP_CERT", "SSL_CERT_FILE"), ("PIP_INDEX_URL", "UV_DEFAULT_INDEX")):
        if os.environ.get(pip_name):
            variables.setdefault(uv_name, os.environ[pip_name])
    return variables


def main(arguments: list[str]) -> None:
    names = arguments or ["development"]
    for name in names:
        if name not in ENVIRONMENTS:
            raise ToolError(f"'{name}' is no environment; there are {', '.join(ENVIRONMENTS)}")
        ensure(name)


if __name__ == "__main__":
    command_line(main)
