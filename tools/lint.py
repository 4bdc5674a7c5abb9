"""Checks what can be checked without running: style, format, types, import rules.

.venv/bin/python tools/lint.py
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import import_rules
from environments import PACKAGES
from project import ROOT, ToolError, command_line, run

# bpy has no types that hold for all its versions, so addon/blender and the samples are not type-checked.
TYPED = ("meniscus.addon.fluid", "meniscus.addon.output", "meniscus.addon.render", "meniscus.gpu_shaders")


def lint() -> None:
    """Run every check; ToolError at the first that fails."""
    programs = Path(sys.executable).parent
    run([programs / "ruff", "check", "--quiet", "."])
    run([programs / "ruff", "format", "--check", "--quiet", "."])
    check_types(programs / "mypy")
    import_rules.main([])


def check_types(mypy: Path) -> None:
    """Check the package under its own name, whatever the clone's folder is called, then the tools."""
    cache = ["--cache-dir", str(ROOT / ".mypy_cache")]
    variables = {**os.environ, "MYPYPATH": str(PACKAGES)}
    config = ["--config-file", str(ROOT / "pyproject.toml")]
    packages = [word for package in TYPED for word in ("-p", package)]
    # From elsewhere: the repository's root is a package, and mypy would find it under a second name.
    run([mypy, *config, *cache, *packages], env=variables, cwd=PACKAGES)
    run([mypy, *config, *cache, *sorted((ROOT / "tools").glob("*.py"))], env={**os.environ, "MYPYPATH": "tools"})


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("lint.py takes no arguments")
    lint()


if __name__ == "__main__":
    command_line(main)
