"""Preview pictures that any program can show."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.errors import OutputError
from ..output.whole_file import whole_file

BACKGROUND = 0.05
"""Linear grey behind the fluid: dark enough for foam, light enough for deep water."""

_LAST_CHUNK = b"IEND\xaeB`\x82"
"""How every whole PNG file ends."""


def write_png(path: str | os.PathLike[str], rgba: npt.NDArray[np.float32]) -> None:
    """Write an image over a neutral background as an 8-bit sRGB PNG, which replaces `path` only when it is whole.

    Parameters
    ----------
    path
        The file; missing folders are made.
    rgba
        (height, width, 4) float32, linear Rec.709, premultiplied alpha, row 0 at the bottom. Values above 1 clip.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    height, width = rgba.shape[:2]
    picture = bpy.data.images.new("Meniscus Preview", width, height)
    try:
        picture.pixels.foreach_set(_display_rgba(rgba).ravel())
        picture.file_format = "PNG"
        with whole_file(path) as temporary:
            _save(picture, temporary, path)
    finally:
        bpy.data.images.remove(picture)


def _save(picture: bpy.types.Image, temporary: Path, path: str | os.PathLike[str]) -> None:
    try:
        picture.save(filepath=str(temporary))
    except RuntimeError as error:
        raise OutputError(f"Cannot write {os.fspath(path)}: {str(error).strip()}") from error
    # Blender does not tell when the disk fills up.
    if not temporary.read_bytes().endswith(_LAST_CHUNK):
        raise OutputError(f"Cannot write {os.fspath(path)}: the disk is full; free some space or choose another folder")


def _display_rgba(rgba: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(height, width, 4) in 0 .. 1, opaque, encoded with the sRGB transfer function (IEC 61966-2-1)."""
    display = np.ones_like(rgba)
    linear = np.clip(rgba[..., :3] + (1 - rgba[..., 3:]) * BACKGROUND, 0, 1)
    display[..., :3] = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return display
