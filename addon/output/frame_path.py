"""File names with a frame number in them."""

from __future__ import annotations

import re
from pathlib import Path

_LAST_HASHES = re.compile(r"#+(?=[^#]*$)")


def numbered_pattern(pattern: str) -> str:
    """`pattern` with ``####`` before its extension if its file name has no ``#``, as Blender does for animations."""
    path = Path(pattern)
    return pattern if "#" in path.name else str(path.with_name(f"{path.stem}####{path.suffix}"))


def frame_path(pattern: str, frame: int) -> Path:
    """`pattern` with the last run of ``#`` in its file name replaced by the frame number, padded with zeros."""
    path = Path(pattern)
    sign = "-" if frame < 0 else ""
    return path.with_name(_LAST_HASHES.sub(lambda hashes: sign + str(abs(frame)).zfill(len(hashes[0])), path.name))
