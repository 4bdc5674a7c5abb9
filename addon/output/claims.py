"""Files that are there, that another process is about to write, or that were left unfinished."""

from __future__ import annotations

import os
import re
from pathlib import Path

from .whole_file import prepare_place, this_host

_MARK = b"Meniscus renders this frame: "


def is_taken(path: Path) -> bool:
    """Whether a file is whole, or claimed by a process that may still be running.

    Claims of processes of this computer that have ended do not count, so that a range that was killed can be finished; of
    those of others nothing is known, and they do.
    """
    try:
        with path.open("rb") as file:
            head = file.read(256)
    except OSError:
        return False
    if not head.startswith(_MARK):
        return len(head) > 0
    host, _, number = head[len(_MARK) :].decode(errors="replace").rpartition(" ")
    return host != this_host() or (number.isdigit() and _runs(int(number)))


def claim(path: Path) -> bool:
    """Put a placeholder where a file will be; False where another process was quicker. OutputError where that is impossible."""
    prepare_place(path)
    if not is_taken(path):
        path.unlink(missing_ok=True)
    try:
        file = path.open("xb")
    except FileExistsError:
        return False
    except OSError:
        return True  # what is wrong with the place is told when the file is written
    try:
        with file:
            file.write(_MARK + f"{this_host()} {os.getpid()}".encode())
    except OSError:  # half a mark would count as a file
        path.unlink(missing_ok=True)
    return True


def give_up(path: Path) -> None:
    """Take the placeholder of this process away, where it is still there."""
    try:
        with path.open("rb") as file:
            is_ours = file.read(256) == _MARK + f"{this_host()} {os.getpid()}".encode()
    except OSError:
        return
    if is_ours:
        path.unlink(missing_ok=True)


def remove_leftovers(path: Path) -> None:
    """Delete unfinished files beside `path` whose processes, of this computer, have ended."""
    pattern = re.compile(rf"\.{re.escape(path.stem)}\.{re.escape(this_host())}\.(\d+)\.tmp{re.escape(path.suffix)}")
    try:
        names = [entry for entry in os.listdir(path.parent) if entry.startswith(f".{path.stem}.")]
    except OSError:
        return
    for name in names:
        match = pattern.fullmatch(name)
        if match and not _runs(int(match[1])):
            (path.parent / name).unlink(missing_ok=True)


def _runs(process: int) -> bool:
    """Whether a process of this computer may be running."""
    if process == os.getpid() or os.name == "nt":  # Windows would end a process that is asked
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it belongs to somebody else, or the system does not tell
        return True
    return not _is_zombie(process)


def _is_zombie(process: int) -> bool:
    """Whether a process has ended, but its parent has not asked for its status; known on Linux only."""
    try:
        state = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return state.rpartition(")")[2].split()[:1] == ["Z"]
