"""A camera in scene coordinates, world space less an origin, as lib/scene_camera.glsl wants it."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from ..addon.fluid.camera import Camera
from .camera_parts import camera_uniforms, depth_scale


def scene_camera_uniforms(box: npt.NDArray[np.floating], origin: npt.NDArray[np.float64], camera: Camera) -> dict[str, object]:
    """A camera that begins at a plane near what is seen: what is large is subtracted here, in double precision.

    Parameters
    ----------
    box
        (2, 3): the least and the greatest corner of what is seen, scene coordinates; not finite where there is nothing.
    origin
        (3,), world space: where scene coordinates are 0.
    """
    forward = -camera.world_from_view[:3, 2]
    depth = first_depth(box.astype(np.float64) + origin, camera)
    anchor = camera.eye + depth * forward - origin
    return {
        **camera_uniforms(camera),
        "anchor": tuple(anchor.tolist()),
        "anchor_depth": depth,
        "clip_depths": (camera.clip_start - depth, camera.clip_end - depth),
    }


def box_depths(box: npt.NDArray[np.float64], camera: Camera) -> npt.NDArray[np.float64]:
    """(8,): the planar depths of the corners of a box (2, 3) in world space."""
    corners = np.array([[box[side, axis] for axis, side in enumerate(corner)] for corner in product((0, 1), repeat=3)])
    depths: npt.NDArray[np.float64] = (corners - camera.eye) @ -camera.world_from_view[:3, 2]
    return depths


def first_depth(box: npt.NDArray[np.float64], camera: Camera) -> float:
    """The planar depth at which the box begins, between the clip distances."""
    if not np.all(np.isfinite(box)):
        return camera.clip_start
    return min(max(float(np.min(box_depths(box, camera))), camera.clip_start), camera.clip_end)


def scene_depth_scale(camera: Camera, box: npt.NDArray[np.float64]) -> float:
    """See :func:`camera_parts.depth_scale`: of distances along rays from the plane at which the camera begins, to all of a box
    (2, 3) in world space.
    """
    window = camera.window
    slopes = max(abs(window.left), abs(window.right)), max(abs(window.bottom), abs(window.top))
    stretch = math.hypot(1.0, *slopes) if camera.is_perspective else 1.0
    farthest = stretch * (float(np.max(box_depths(box, camera))) - first_depth(box, camera))
    return depth_scale(max(farthest, 1e-30))
