"""Checks what can be checked without running: style, format, types, import rules, shaders; in Python, GLSL and Rust.

.venv/bin/python tools/lint.py
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import import_rules
import rust
import shader_lint
from environments import PACKAGES
from project import ROOT, ToolError, command_line, run

# bpy has no types that hold for all its versions, so addon/blender is not type-checked.
TYPED = ("meniscus.addon.fluid", "meniscus.addon.output", "meniscus.addon.render", "meniscus.gpu_shaders", "meniscus.samples")

MYPY_OPTIONS = ("--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(ROOT / ".mypy_cache"))


def lint() -> None:
    """Run every check; ToolError names those that failed, after all have run."""
    programs = Path(sys.executable).parent
    checks = {
        "style": lambda: run([programs / "ruff", "check", "--quiet", "."]),
        "format": lambda: run([programs / "ruff", "format", "--check", "--quiet", "."]),
        "types of the package": lambda: check_package_types(programs / "mypy"),
        "types of the tools": lambda: check_tools_types(programs / "mypy"),
        "import rules": lambda: import_rules.main([]),
        "shaders": lambda: shader_lint.main([]),
        "format of the Rust code": check_rust_format,
        "Rust code": check_rust,
    }
    failed = [name for name, check in checks.items() if not passes(check)]
    if failed:
        raise ToolError(f"lint failed: {', '.join(failed)} (see above).")


def passes(check: Callable[[], None]) -> bool:
    try:
        check()
    except ToolError as error:
        print(error, flush=True)
        return False
    return True


def check_package_types(mypy: Path) -> None:
    """Check the package under its own name, whatever the clone's folder is called.

    It runs elsewhere: the repository's root is a package itself, and mypy would find it under a second name.
    """
    packages = [word for package in TYPED for word in ("-p", package)]
    run([mypy, *MYPY_OPTIONS, *packages], env={**os.environ, "MYPYPATH": str(PACKAGES)}, cwd=PACKAGES)


def check_tools_types(mypy: Path) -> None:
    tools = ROOT / "tools"
    run(
        [mypy, *MYPY_OPTIONS, *sorted(tools.glob("*.py"))],
        env={**os.environ, "MYPYPATH": f"{tools}{os.pathsep}{PACKAGES}"},
        cwd=tools,
    )


def check_rust_format() -> None:
    run(["cargo", "fmt", "--all", "--check"], env=rust.stable(), cwd=rust.NATIVE)


def check_rust() -> None:
    options = ["--quiet", "--locked", "--all-targets"]
    run(["cargo", "clippy", *options, "--", "-D", "warnings"], env=rust.stable(), cwd=rust.NATIVE)


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("lint.py takes no arguments")
    lint()


if __name__ == "__main__":
    command_line(main)
