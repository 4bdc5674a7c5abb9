"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..fluid.errors import FullDiskError, OutputError

_FULL_DISK = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}


def temporary_path(path: Path, process_id: int) -> Path:
    """The name that `path` has while a process of this computer writes it: hidden, beside it, with the same extension."""
    return path.with_name(f".{path.stem}.{this_host()}.{process_id}.tmp{path.suffix}")


def this_host() -> str:
    """The computer's name, as part of file names."""
    return re.sub(r"\W", "-", socket.gethostname())


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Gives a temporary path to write to; it takes the place of `path` when the block ends without an error.

    Missing folders are made. After an error the temporary file is gone and what was at `path` is as it was.

    Raises
    ------
    OutputError
        The folder cannot be made, the file cannot be written or the disk is full.
    """
    target = Path(path).absolute()
    prepare_place(target)
    temporary = temporary_path(target, os.getpid())
    try:
        yield temporary
        _flush_to_disk(temporary)
        temporary.replace(target)
    except OSError as error:
        raise _write_error(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def prepare_place(path: Path) -> None:
    """Make the folder of `path`; raises OutputError where that or writing there is impossible."""
    if path.is_dir():
        raise OutputError(f"Cannot write {path}: it is a folder; add a file name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {path.parent}: {_reason(error)}; choose another folder") from error
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"Cannot write into the folder {path.parent}; check its permissions or choose another folder")


def _write_error(path: Path, error: OSError) -> OutputError:
    """What the user is told when writing `path` fails."""
    if error.errno in _FULL_DISK:
        return FullDiskError(f"Cannot write {path}: the disk is full; free some space or choose another folder")
    return OutputError(f"Cannot write {path}: {_reason(error)}; check the permissions or choose another folder")


def _flush_to_disk(path: Path) -> None:
    """A full disk or a lost network drive may show only here.

    The system then need not keep the file in memory: a sequence would push out what is read for its frames, and fresh memory
    for every file takes the system longer than filling it.
    """
    with path.open("rb+") as file:
        os.fsync(file.fileno())
        if hasattr(os, "posix_fadvise"):
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _reason(error: OSError) -> str:
    reason = error.strerror or str(error)
    return reason[:1].lower() + reason[1:]
