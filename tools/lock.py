"""Pins what requirements/*.in ask for, with hashes, and brings the manifest's wheels up to date (see `make lock`)."""

from __future__ import annotations

import extension_wheels
from environments import ENVIRONMENTS, ensure_uv, uv_variables
from project import REQUIREMENTS, ToolError, command_line, run

# Lists that no environment of ours is made of; they serve several Pythons, the oldest decides.
OTHER_LOCKS = {"uv.txt": "3.9", "extension.txt": "3.11", "program.txt": "3.11"}


def locks() -> dict[str, str]:
    """Every lock file and the Python that it is resolved for."""
    of_environments = {lock: python for row in ENVIRONMENTS.values() for python, lock in row.locks.items()}
    return {**OTHER_LOCKS, **of_environments}


def compile_lock(lock: str, python: str) -> None:
    source = REQUIREMENTS / lock.replace(".txt", ".in")
    options = ["--quiet", "--generate-hashes", "--no-emit-index-url", "--no-header", "--no-annotate"]
    options += ["--python-version", python]
    if lock == "extension.txt":
        options.append("--no-deps")  # numpy comes with Blender
    run([ensure_uv(), "pip", "compile", *options, source, "-o", REQUIREMENTS / lock], env=uv_variables())


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("lock.py takes no arguments")
    for lock, python in locks().items():
        compile_lock(lock, python)
    extension_wheels.write_manifest()


if __name__ == "__main__":
    command_line(main)
