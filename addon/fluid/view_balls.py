"""Balls as a camera sees them: in view space, those outside the view left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .balls import Balls
from .camera import Camera
from .field import Field

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ViewBalls:
    """The M balls whose influence spheres meet the view.

    Attributes
    ----------
    centers
        (M, 3) float64, view space. Double precision, because only the subtraction of the eye makes them small.
    radii, weights
        (M,) float64: influence radii R and weights q.
    kernel_radii
        (M,) float64: radii of the kernel spheres, 0 where a ball alone has no surface.
    colors
        (M, 3) float32 linear Rec.709, or None.
    indices
        (M,) int64: which of all the balls they are.
    """

    centers: FloatArray
    radii: FloatArray
    weights: FloatArray
    kernel_radii: FloatArray
    colors: npt.NDArray[np.float32] | None
    indices: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.radii)


def view_balls(balls: Balls, camera: Camera, field: Field) -> ViewBalls:
    """Move the balls into view space and keep those whose influence sphere meets the view between its clip distances."""
    rotation = camera.world_from_view[:3, :3]
    # Coordinates in rows: products of (3, 3) with (3, N) are fast, those of (N, 3) with (3, 3) are not.
    centers = (rotation.T @ (balls.positions.T - camera.eye[:, None])).T
    radii = balls.radii.astype(np.float64)
    seen = meets_view(centers, radii, camera)
    weights = balls.weights[seen].astype(np.float64)
    return ViewBalls(
        centers[seen],
        radii[seen],
        weights,
        field.kernel_radii(radii[seen], weights),
        None if balls.colors is None else np.ascontiguousarray(balls.colors[seen]),
        np.flatnonzero(seen),
    )


def meets_view(centers: FloatArray, radii: FloatArray, camera: Camera) -> npt.NDArray[np.bool_]:
    """Conservative: whether each sphere reaches past all six planes of the view."""
    x, y, depth = centers[:, 0], centers[:, 1], -centers[:, 2]
    seen = (depth + radii > camera.clip_start) & (depth - radii < camera.clip_end)
    window = camera.window
    for coordinate, low, high in ((x, window.left, window.right), (y, window.bottom, window.top)):
        for edge, side in ((low, 1.0), (high, -1.0)):
            # The plane through the eye and the window's edge, or parallel to the view direction through the edge.
            offset = coordinate - edge * (depth if camera.is_perspective else 1.0)
            reach = radii * (np.hypot(1.0, edge) if camera.is_perspective else 1.0)
            seen &= side * offset > -reach
    return seen
