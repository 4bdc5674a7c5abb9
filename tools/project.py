"""What every tool here shares: where things lie, how a command is run, how an error reaches the user."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CACHE = Path(os.environ.get("MENISCUS_CACHE") or ROOT / ".cache").resolve()
REQUIREMENTS = ROOT / "requirements"


class ToolError(Exception):
    """A tool cannot go on: one sentence that says what is wrong and what to do."""


def run(command: Sequence[str | Path], *, env: Mapping[str, str] | None = None, cwd: Path = ROOT) -> None:
    """Run a command, its output shown as it comes; ToolError where it fails."""
    words = [str(word) for word in command]
    status = subprocess.run(words, env=dict(env) if env else None, cwd=cwd, stdin=subprocess.DEVNULL, check=False).returncode
    if status:
        raise ToolError(f"This command failed with exit status {status}: {' '.join(words)}")


def output_of(command: Sequence[str | Path], *, env: Mapping[str, str] | None = None) -> str:
    """The standard output of a command; ToolError with its standard error where it fails."""
    words = [str(word) for word in command]
    variables = dict(env) if env else None
    done = subprocess.run(words, env=variables, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ToolError(f"This command failed: {' '.join(words)}\n{done.stderr.strip() or done.stdout.strip()}")
    return done.stdout


def fingerprint(*parts: str | Path) -> str:
    """A hash over texts and the contents of files: it changes when one of them does."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.read_bytes() if isinstance(part, Path) else part.encode())
        digest.update(b"\0")
    return digest.hexdigest()


@contextlib.contextmanager
def locked(name: str) -> Iterator[None]:
    """Let one process at a time set up `name`; the others wait."""
    folder = CACHE / "locks"
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / name, "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def command_line(main: Callable[[list[str]], int | None]) -> None:
    """Run a tool's main function; an error becomes one sentence on stderr and exit status 1."""
    try:
        sys.exit(main(sys.argv[1:]))
    except ToolError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
