"""The exact caster that everything else is judged by: any rays, all crossings, double precision.

The fluid is where the density exceeds the isovalue. A crossing is where a ray goes from outside to inside or back, at a
distance greater than 0: crossings alternate, and the surface at the very start of a ray is not seen. A ray that only touches
the fluid does not cross it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.field import Field
from .native import fluid_arguments, let_interrupt, load, numbers, translated_errors

FloatArray = npt.NDArray[np.float64]


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
        The arrays have the wrong shape, a number is not finite, or a direction is zero.
    DeviceError
        The native core is missing, or there is too little memory.
    """
    with translated_errors():
        t, normals = load().oracle_cast(*_arguments(balls, field, origins, directions), watch=let_interrupt)
    return t, normals


def crossings(
    balls: Balls, field: Field, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> tuple[npt.NDArray[np.int64], FloatArray, npt.NDArray[np.bool_]]:
    """Find all crossings of rays with the isosurface.

    The parameters and the errors are those of :func:`cast`.

    Returns
    -------
    rays : (total,) int64
        Index of the ray of each crossing, ascending.
    t : (total,) float64
        Distance along the unit ray, Blender units, greater than 0 and ascending within a ray.
    is_entering : (total,) bool
        Whether the ray goes into the fluid there. Within a ray true and false alternate; the first is false where the ray
        starts inside.
    """
    with translated_errors():
        rays, t, is_entering = load().oracle_crossings(*_arguments(balls, field, origins, directions), watch=let_interrupt)
    return rays, t, is_entering


def _arguments(balls: Balls, field: Field, origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[Any, ...]:
    return *fluid_arguments(balls, field), numbers("origins", origins), numbers("directions", directions)
