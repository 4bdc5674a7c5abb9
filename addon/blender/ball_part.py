"""What one source supplies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.turning import turned

FloatArray = npt.NDArray[np.float32]


@dataclass(frozen=True)
class BallPart:
    """Balls of one source, before all are joined.

    Attributes
    ----------
    positions
        (N, 3) float32, world space, Blender units.
    radii
        (N,) float32 influence radii, world space, Blender units.
    weight
        Of each ball.
    colors
        (N, 3) float32 or one colour (3,), linear Rec.709; None where the scene's colour holds.
    velocities
        (N, 3) float32, world space, Blender units a second; None where unknown.
    ids
        (N,) int32; None where unknown.
    source
        Index of the object.
    world_from_object
        (4, 4) float64: the object's place, where it may move and `velocities` do not know of that; None elsewhere.
    """

    positions: FloatArray
    radii: FloatArray
    weight: float
    colors: FloatArray | None
    velocities: FloatArray | None
    ids: npt.NDArray[np.int32] | None
    source: int = 0
    world_from_object: npt.NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.positions)


def transformed_points(points: FloatArray, transform: npt.NDArray[np.float64]) -> FloatArray:
    """`points` (N, 3) moved by the affine `transform` (4, 4)."""
    if np.array_equal(transform, np.eye(4)):
        return points
    moved = transformed_vectors(points, transform)
    moved += transform[:3, 3].astype(np.float32)
    return moved


def transformed_vectors(vectors: FloatArray, transform: npt.NDArray[np.float64]) -> FloatArray:
    """`vectors` (N, 3) turned and scaled by the linear part of `transform` (4, 4)."""
    return turned(vectors, transform[:3, :3].T.astype(np.float32))


def mean_scale(transform: npt.NDArray[np.float64]) -> np.float32:
    """The factor by which `transform` (4, 4) scales a length on average: the cube root of its volume's factor."""
    return np.float32(np.cbrt(abs(np.linalg.det(transform[:3, :3]))))
