"""What a viewport must show: at each pixel the fluid, by the exact oracle, or a mesh, by geometry, or the background."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import gpu
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

FloatArray = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
FRAME = 24
"""Pixels at the edges of a viewport, where Blender draws rounded corners and arrows that show hidden regions."""

Caster = Callable[[FloatArray, FloatArray], FloatArray]
"""From origins and unit directions (count, 3), world space, to the distances (count,) of what is met first, else infinity."""


def pixel_rays(clip_from_world: FloatArray, width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """Origins on the near plane and unit directions (height * width, 3), world space, through pixel centres, row by row."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, (np.arange(height) + 0.5) / height * 2 - 1)
    near, far = (np.stack([x, y, np.full_like(x, z), np.ones_like(x)], axis=-1).reshape(-1, 4) for z in (-1.0, 1.0))
    world_from_clip = np.linalg.inv(clip_from_world)
    near, far = ((points @ world_from_clip.T) for points in (near, far))
    origins, ends = near[:, :3] / near[:, 3:], far[:, :3] / far[:, 3:]
    directions = ends - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def box(center: Sequence[float], half_size: float) -> Caster:
    """An axis-aligned cube."""

    def cast(origins: FloatArray, directions: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (np.asarray(center) + np.array([[[-half_size]], [[half_size]]]) - origins) / directions
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        return np.where((enter <= leave) & (leave > 0), enter, np.inf)

    return cast


def nearest(casters: Sequence[Caster], clip_from_world: FloatArray, width: int, height: int) -> npt.NDArray[np.int64]:
    """(height, width): which of the casters is met first at each pixel, -1 where none is."""
    rays = pixel_rays(clip_from_world, width, height)
    distances = np.array([cast(*rays) for cast in casters])
    return np.where(np.isfinite(distances.min(axis=0)), distances.argmin(axis=0), -1).reshape(height, width)


def is_inner(labels: npt.NDArray[np.generic], width: int | None = None) -> Bools:
    """(height, width): whether all pixels around have the same label, out to `width`, else that of a border (`border_width`).

    Nothing is, in the frame that Blender draws over.
    """
    width = border_width() if width is None else width
    least = greatest = np.pad(labels, width, mode="edge")
    for axis in (0, 1):
        least = sliding_window_view(least, 2 * width + 1, axis).min(axis=-1)
        greatest = sliding_window_view(greatest, 2 * width + 1, axis).max(axis=-1)
    inner = least == greatest
    inner[:FRAME] = inner[-FRAME:] = inner[:, :FRAME] = inner[:, -FRAME:] = False
    return inner


def is_steady(picture: npt.NDArray[np.uint8]) -> Bools:
    """(height, width): whether Blender draws the pixel the same each time."""
    if border_width() == 1:
        return np.ones(picture.shape[:2], np.bool_)
    return is_inner(picture.astype(np.int64) @ (1 << 16, 1 << 8, 1))


def border_width() -> int:
    """Pixels at borders that are not compared: Blender on software Vulkan leaves black specks at those of meshes."""
    return 3 if gpu.platform.backend_type_get() == "VULKAN" else 1


def srgb_bytes(linear: Sequence[float]) -> npt.NDArray[np.uint8]:
    """A linear Rec.709 colour as an sRGB screen shows it: (3,) bytes."""
    values = np.clip(np.asarray(linear, np.float64), 0, 1)
    encoded = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    return np.rint(255 * encoded).astype(np.uint8)
