"""The balls of a frame as the shaders read them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera
from ....addon.fluid.field import Field
from ....addon.fluid.view_balls import ViewBalls
from ...camera_parts import camera_uniforms
from .groups import spatial_order
from .programs import BALL_TEXTURE_WIDTH


def in_spatial_order(balls: ViewBalls) -> ViewBalls:
    """The balls with neighbours in space close to one another in the arrays."""
    order = spatial_order(balls.centers)
    arrays = {field.name: getattr(balls, field.name) for field in fields(balls)}
    return replace(balls, **{name: array[order] for name, array in arrays.items() if array is not None})


def ball_textures(gl: moderngl.Context, balls: ViewBalls, with_colors: bool) -> dict[str, moderngl.Texture]:
    """The balls as float textures, by sampler name."""
    arrays = {
        "sphere_tx": np.column_stack([balls.centers, balls.radii]).astype(np.float32),
        "density_tx": np.column_stack([balls.weights, balls.kernel_radii]).astype(np.float32),
    }
    if with_colors and balls.colors is not None:
        arrays["color_tx"] = np.column_stack([balls.colors, np.ones(len(balls), np.float32)])
    return {name: _texture_of_rows(gl, array) for name, array in arrays.items()}


def _texture_of_rows(gl: moderngl.Context, rows: npt.NDArray[np.float32]) -> moderngl.Texture:
    """(M, components) as a texture with one texel a row, left to right and on the next line after BALL_TEXTURE_WIDTH."""
    lines = -(-len(rows) // BALL_TEXTURE_WIDTH)
    padded = np.zeros((lines * BALL_TEXTURE_WIDTH, rows.shape[1]), np.float32)
    padded[: len(rows)] = rows
    texture = gl.texture((BALL_TEXTURE_WIDTH, lines), rows.shape[1], padded, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


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
        scale = 2.0 ** -(np.ceil(np.log2(max(float(np.max(distances + balls.radii)), start))) + 1)
        may_start_inside = bool(np.any(distances - balls.radii <= start * (1 + 1e-5)))
        # The shaders round where each ray starts, and must not find it beyond the greatest.
        return cls(float(scale), start * float(scale) * (1 + 1e-6), may_start_inside or bool(np.any(balls.weights < 0)))


def _steepest_slope(camera: Camera) -> tuple[float, float]:
    if not camera.is_perspective:
        return 0.0, 0.0
    window = camera.window
    return max(abs(window.left), abs(window.right)), max(abs(window.bottom), abs(window.top))


def frame_uniforms(balls: ViewBalls, distances: BallDistances, camera: Camera, field: Field) -> dict[str, object]:
    """What the shaders of lib/ and this method share."""
    return {
        **camera_uniforms(camera),
        "isovalue": field.threshold,
        "depth_scale": distances.depth_scale,
        "farthest_start": distances.farthest_start,
        "walk_window": float(np.median(balls.radii)),
    }
