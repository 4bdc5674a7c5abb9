"""The exact caster that everything else is judged by: any rays, all crossings, double precision."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.errors import InputError
from ..fluid.field import Field
from .exact_intervals.crossings import Rays, Spheres, cross, first_crossings, normals

FloatArray = npt.NDArray[np.float64]

# Distances that are held at once while looking for the pairs of rays and balls that meet.
_CHUNK = 4_000_000


def cast(balls: Balls, field: Field, origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Find where rays first cross the isosurface, in either direction.

    Parameters
    ----------
    origins, directions
        (count, 3), world space. Directions need not be unit.

    Returns
    -------
    t : (count,) float64
        Distance along the unit ray, Blender units; infinite where it does not cross.
    normals : (count, 3) float64
        Unit, world space, out of the fluid; 0 where the ray does not cross.

    Raises
    ------
    InputError
        The arrays have the wrong shape, or a direction is zero or not finite.
    """
    rays = _rays(np.asarray(origins, np.float64), np.asarray(directions, np.float64))
    radii, weights = balls.radii.astype(np.float64), balls.weights.astype(np.float64)
    spheres = Spheres(balls.positions.astype(np.float64), radii, weights, field.kernel_radii(radii, weights))
    t, normal = np.empty(len(rays)), np.empty((len(rays), 3))
    step = min(4096, max(1, _CHUNK // max(len(balls), 1)))
    for begin in range(0, len(rays), step):
        part = slice(begin, begin + step)
        chunk = Rays(rays.origins[part], rays.directions[part], rays.start[part], rays.end[part])
        pairs = cross(chunk, spheres, *_candidates(chunk, spheres))
        t[part] = first_crossings(chunk, spheres, pairs, field)
        normal[part] = normals(chunk, spheres, pairs, t[part], field)
    return t, normal


def _rays(origins: FloatArray, directions: FloatArray) -> Rays:
    if origins.ndim != 2 or origins.shape[1] != 3 or directions.shape != origins.shape:
        raise InputError(f"origins and directions must both have the shape (N, 3), not {origins.shape} and {directions.shape}")
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    if not (np.all(np.isfinite(origins)) and np.all(np.isfinite(length)) and np.all(length > 0)):
        raise InputError("origins and directions must be finite, and no direction may be zero")
    return Rays(origins, directions / length, np.zeros(len(origins)), np.full(len(origins), np.inf))


def _candidates(rays: Rays, spheres: Spheres) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Pairs of rays and balls that may meet; a superset, found with matrix products."""
    middle = spheres.centers.mean(axis=0) if len(spheres.centers) else np.zeros(3)
    centers, origins = spheres.centers - middle, rays.origins - middle
    along = rays.directions @ centers.T - np.einsum("ij,ij->i", origins, rays.directions)[:, None]
    squares = np.einsum("ij,ij->i", origins, origins)[:, None] + np.einsum("ij,ij->i", centers, centers)
    distance_2 = squares - 2 * origins @ centers.T
    # The products cancel; widen by more than their rounding.
    ray, ball = np.nonzero(distance_2 - along**2 <= spheres.radii**2 + 1e-12 * (squares + along**2))
    return ray, ball
