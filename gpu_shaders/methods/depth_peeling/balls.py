"""The balls of a frame as this method orders them."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from ....addon.fluid.camera import Camera
from ....addon.fluid.field import Field
from ....addon.fluid.view_balls import ViewBalls
from ...ball_textures import BallDistances
from ...camera_parts import camera_uniforms
from .groups import spatial_order


def in_spatial_order(balls: ViewBalls) -> ViewBalls:
    """The balls with neighbours in space close to one another in the arrays."""
    order = spatial_order(balls.centers)
    arrays = {field.name: getattr(balls, field.name) for field in fields(balls)}
    return replace(balls, **{name: array[order] for name, array in arrays.items() if array is not None})


def frame_uniforms(balls: ViewBalls, distances: BallDistances, camera: Camera, field: Field) -> dict[str, object]:
    """What the shaders of lib/ and this method share."""
    return {
        **camera_uniforms(camera),
        "isovalue": field.threshold,
        "depth_scale": distances.depth_scale,
        "farthest_start": distances.farthest_start,
        "walk_window": float(np.median(balls.radii)),
    }
