"""Pictures of the screen as arrays: (height, width, 3) bytes, red first, row 0 at the bottom."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]

AMPLIFICATION = 16
"""How many times stronger differences are shown than they are."""


def screen_picture() -> Picture:
    """What the X server shows. It keeps its screen in an XWD file."""
    content = Path(os.environ["MENISCUS_SCREEN"]).read_bytes()
    header_size, _, _, _, width, height, *_ = header = np.frombuffer(content, ">u4", 25).tolist()
    bytes_per_line, color_count = header[12], header[19]
    pixels = np.frombuffer(content, np.uint8, bytes_per_line * height, header_size + 12 * color_count)
    blue_first = pixels.reshape(height, bytes_per_line)[::-1, : 4 * width].reshape(height, width, 4)
    return np.ascontiguousarray(blue_first[..., 2::-1])


def check_same(
    name: str, actual: Picture, expected: Picture, where: npt.NDArray[np.bool_] | None = None, tolerance: int = 2
) -> None:
    """Fail where pictures differ by more than `tolerance`, and leave both and their difference beside one another as NAME.png.

    `where` (height, width) says which pixels count; all if left out. No pixel of these may differ.
    """
    difference = np.abs(actual.astype(int) - expected)
    is_wrong = difference.max(axis=2) > tolerance
    if where is not None:
        is_wrong &= where
        difference *= where[..., None]
    if is_wrong.any():
        shown = np.minimum(AMPLIFICATION * difference, 255).astype(np.uint8)
        path = write(name, np.hstack([actual, expected, shown]))
        y, x = np.argwhere(is_wrong)[len(np.argwhere(is_wrong)) // 2]
        raise AssertionError(
            f"{name}: {is_wrong.sum()} of {is_wrong.size if where is None else where.sum()} pixels differ, "
            f"({x}, {y}) from the lower left is {actual[y, x]} and should be {expected[y, x]}; see {path.name}"
        )


def write(name: str, picture: Picture) -> Path:
    """Leave a picture as NAME.png for whoever looks into a failure."""
    path = Path(os.environ["MENISCUS_PICTURES"]) / f"{name}.png"
    path.write_bytes(png(picture))
    return path


def png(picture: Picture) -> bytes:
    """A PNG file; there is no image library in Blender's Python."""
    height, width, _ = picture.shape
    rows = np.pad(picture[::-1].reshape(height, 3 * width), ((0, 0), (1, 0)))  # each begins with the number of its filter: none
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*part) for part in parts)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
