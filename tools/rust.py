"""The Rust toolchains: the machine's own where they serve, else pinned ones, fetched into the cache.

.venv/bin/python tools/rust.py COMMAND [ARGUMENT ...]     run a command in native/ with the toolchain that builds it

The machine's own installation is never changed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import environments
from project import CACHE, ROOT, ToolError, command_line, fingerprint, locked, output_of, run
from system_packages import apt_install, is_root_on_debian

NATIVE = ROOT / "native"
RUSTUP_HOME = CACHE / "rust"


@dataclass(frozen=True)
class Pinned:
    """A toolchain as rustup names it, what it calls itself, and the components that the tools here need."""

    name: str
    version: str
    components: tuple[str, ...]


STABLE = Pinned("1.95.0", "1.95.0 (59807616e 2026-04-14)", ("clippy", "rustfmt"))
# The address sanitizer, Miri and fuzzing need unstable options.
NIGHTLY = Pinned("nightly-2026-05-20", "1.97.0-nightly (e50aa6fba 2026-05-19)", ("miri", "rust-src"))

# The linker of what runs while others are compiled; libFuzzer is C++.
COMPILERS = {"cc": "gcc", "c++": "g++"}


def stable(target: str | None = None) -> dict[str, str]:
    """The environment variables with which cargo is at least the workspace's `rust-version` and compiles for `target`."""
    ensure_compilers()
    own = dict(os.environ)
    is_whole = is_recent(own) and all(works(own, "cargo", program, "--version") for program in ("fmt", "clippy"))
    if is_whole and (target is None or has_target(own, target)):
        return own
    return fetched(STABLE, target)


def nightly() -> dict[str, str]:
    """The environment variables with which cargo is exactly the pinned nightly: unstable options change."""
    ensure_compilers()
    cargo = printed(dict(os.environ), "rustup", "which", "--toolchain", "nightly", "cargo")
    own = with_programs(Path(cargo).parent) if cargo else {}
    if own and printed(own, "rustc", "--version") == f"rustc {NIGHTLY.version}" and is_complete_nightly(own):
        return own
    return fetched(NIGHTLY)


def required_version() -> str:
    """The workspace's `rust-version`."""
    return workspace_value("rust-version")


def workspace_value(key: str) -> str:
    found = re.search(rf'^{key} = "(.+)"', (NATIVE / "Cargo.toml").read_text(), re.MULTILINE)
    if found is None:
        raise ToolError(f"native/Cargo.toml has no {key}.")
    return found[1]


def is_recent(variables: Mapping[str, str]) -> bool:
    """Whether both programs run (rustup's stand-ins may have nothing behind them) and are not too old."""
    found = re.match(r"rustc (\d+)\.(\d+)", printed(variables, "rustc", "--version"))
    required = tuple(int(number) for number in required_version().split("."))
    return found is not None and tuple(map(int, found.groups())) >= required and works(variables, "cargo", "--version")


def has_target(variables: Mapping[str, str], target: str) -> bool:
    folder = printed(variables, "rustc", "--print", "target-libdir", "--target", target)
    return bool(folder) and any(Path(folder).glob("libcore-*.rlib"))


def is_complete_nightly(variables: Mapping[str, str]) -> bool:
    sources = Path(printed(variables, "rustc", "--print", "sysroot")) / "lib/rustlib/src/rust/library/Cargo.lock"
    return sources.is_file() and works(variables, "cargo", "miri", "--version")


def fetched(toolchain: Pinned, target: str | None = None) -> dict[str, str]:
    """The variables of a pinned toolchain in the cache, fetched by a pinned rustup if it is not there yet."""
    stamp = RUSTUP_HOME / f"stamp-{fingerprint(toolchain.name, *toolchain.components, target or '')}"
    rustup = environments.ensure("native-tools").python.with_name("rustup")
    variables = {**os.environ, "RUSTUP_HOME": str(RUSTUP_HOME)}
    with locked("rust"):
        if not stamp.is_file():
            fetch(rustup, toolchain, target, variables)
            stamp.touch()
    cargo = output_of([rustup, "which", "--toolchain", toolchain.name, "cargo"], env=variables).strip()
    return with_programs(Path(cargo).parent)


def fetch(rustup: Path, toolchain: Pinned, target: str | None, variables: Mapping[str, str]) -> None:
    print(f"Fetching Rust {toolchain.name} {f'for {target} ' if target else ''}into {RUSTUP_HOME}", flush=True)
    command = [str(rustup), "toolchain", "install", toolchain.name, "--profile", "minimal", "--no-self-update"]
    command += [word for component in toolchain.components for word in ("--component", component)]
    command += ["--target", target] if target else []
    try:
        output_of(command, env=variables)
    except ToolError as error:
        remedy = f"rustup toolchain install {toolchain.name}" if toolchain is NIGHTLY else f"Rust {required_version()} or later"
        remedy += f" with the target {target}" if target else ""
        raise ToolError(f"Rust {toolchain.name} could not be fetched: install it yourself ({remedy}).\n{error}") from error


def with_programs(folder: Path) -> dict[str, str]:
    """The environment variables with a toolchain's own programs first, without rustup's stand-ins before them."""
    variables = {**os.environ, "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    for name in ("RUSTC", "RUSTUP_TOOLCHAIN"):
        variables.pop(name, None)
    return variables


def ensure_compilers() -> None:
    """Install the missing C and C++ compilers as root on Debian, or name the packages in one sentence."""
    missing = [package for program, package in COMPILERS.items() if shutil.which(program) is None]
    if not missing:
        return
    if not is_root_on_debian():
        raise ToolError(f"Rust needs a compiler of C and C++ to link; install {' '.join(missing)} and try again.")
    apt_install([*missing, "libc6-dev"])


def works(variables: Mapping[str, str], *command: str) -> bool:
    return bool(printed(variables, *command))


def printed(variables: Mapping[str, str], *command: str) -> str:
    """What a command prints, without the line's end; empty where it fails or is not there."""
    program = shutil.which(command[0], path=variables["PATH"])
    if program is None:
        return ""
    words = [program, *command[1:]]
    done = subprocess.run(words, env=dict(variables), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def main(arguments: list[str]) -> None:
    if not arguments:
        raise ToolError("say what to run, for instance: cargo test -p meniscus-core kernel")
    run(arguments, env=stable(), cwd=NATIVE)


if __name__ == "__main__":
    command_line(main)
