"""The balls of a frame as shaders read them from textures."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ..addon.fluid.camera import Camera
from ..addon.fluid.view_balls import ViewBalls
from ..addon.render.method import Attribute
from .camera_parts import depth_scale
from .programs import ROW_TEXTURE_WIDTH
from .row_texture import Rows, row_texture

BALL_TEXTURE_WIDTH = ROW_TEXTURE_WIDTH


def ball_textures(
    gl: moderngl.Context,
    balls: ViewBalls,
    attributes: Collection[Attribute] = (),
    velocities: npt.NDArray[np.float32] | None = None,
) -> dict[str, moderngl.Texture]:
    """The balls as textures, by sampler name: see lib/ball.glsl; those of attributes that are wanted and known.

    Parameters
    ----------
    velocities
        (N, 3) world space: of all the balls that `balls` were taken from.
    """
    arrays: dict[str, Rows] = {
        "sphere_tx": np.column_stack([balls.centers, balls.radii]).astype(np.float32),
        "density_tx": np.column_stack([balls.weights, balls.kernel_radii]).astype(np.float32),
    }
    if "color" in attributes and balls.colors is not None:
        arrays["color_tx"] = _in_four(balls.colors)
    if "velocity" in attributes and velocities is not None:
        arrays["velocity_tx"] = _in_four(velocities[balls.indices])
    if "ball" in attributes:
        arrays["index_tx"] = balls.indices.astype(np.int32)[:, None]
    return {name: row_texture(gl, array) for name, array in arrays.items()}


def _in_four(vectors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.column_stack([vectors, np.ones(len(vectors), np.float32)])


@dataclass(frozen=True)
class BallDistances:
    """How far the balls are, which decides the scale of depths and what must be drawn.

    Attributes
    ----------
    depth_scale
        A power of two, so that scaling loses nothing, which brings all distances below 1/2.
    farthest_start
        The greatest distance at which a ray starts, scaled; not below the true one.
    with_starts
        Whether a ray may start inside the fluid, or a ball has a negative weight.
    """

    depth_scale: float
    farthest_start: float
    with_starts: bool

    @classmethod
    def measure(cls, balls: ViewBalls, camera: Camera) -> BallDistances:
        """Of balls that meet the view of this camera."""
        distances = np.linalg.norm(balls.centers, axis=1) if camera.is_perspective else -balls.centers[:, 2]
        start = camera.clip_start * float(np.hypot.reduce([1.0, *_steepest_slope(camera)]))
        scale = depth_scale(max(float(np.max(distances + balls.radii)), start))
        may_start_inside = bool(np.any(distances - balls.radii <= start * (1 + 1e-5)))
        # The shaders round where each ray starts, and must not find it beyond the greatest.
        return cls(scale, start * scale * (1 + 1e-6), may_start_inside or bool(np.any(balls.weights < 0)))


def _steepest_slope(camera: Camera) -> tuple[float, float]:
    if not camera.is_perspective:
        return 0.0, 0.0
    window = camera.window
    return max(abs(window.left), abs(window.right)), max(abs(window.bottom), abs(window.top))
