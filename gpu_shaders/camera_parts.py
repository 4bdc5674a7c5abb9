"""A camera as shaders know it, and its image in parts."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..addon.fluid.camera import Camera, Region


def camera_uniforms(camera: Camera) -> dict[str, object]:
    """The uniforms of lib/ray.glsl, and what else shaders ask of a camera."""
    window = camera.window
    return {
        "window_middle": ((window.left + window.right) / 2, (window.bottom + window.top) / 2),
        "pixel_size": camera.pixel_size,
        "image_middle": (camera.width / 2, camera.height / 2),
        "image_size": (camera.width, camera.height),
        "is_perspective": camera.is_perspective,
        "clip_distances": (camera.clip_start, camera.clip_end),
        "world_from_view": tuple(camera.world_from_view[:3, :3].T.ravel()),
    }


def depth_scale(farthest: float) -> float:
    """A power of two, so that scaling loses nothing, which brings distances up to this one below 1/2 or, just, to it."""
    return float(2.0 ** -(math.ceil(math.log2(farthest)) + 1))


def image_parts(camera: Camera, most_pixels: int, longest_side: int) -> Iterator[Region]:
    """Parts of the image that fit into textures and into memory, in rows from below."""
    columns = min(camera.width, longest_side)
    rows = max(1, min(most_pixels // columns, longest_side))
    for bottom in range(0, camera.height, rows):
        for left in range(0, camera.width, columns):
            yield Region(left, bottom, min(left + columns, camera.width), min(bottom + rows, camera.height))
