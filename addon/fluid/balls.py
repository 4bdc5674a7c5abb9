"""The particles of a fluid as metaballs."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError

FloatArray = npt.NDArray[np.float32]


class Balls:
    """Metaballs: N centres with an influence radius and a weight each, and what they carry to the surface.

    Parameters
    ----------
    positions
        (N, 3), world space, Blender units.
    radii
        (N,) or one number: influence radii R, Blender units.
    weights
        (N,) or one number: density coefficients q, dimensionless; 1 where None. Negative ones carve.
    colors
        (N, 3) or one colour (3,): linear Rec.709; None where the look decides.
    velocities
        (N, 3), world space, Blender units a second; None where unknown.
    ids
        (N,) integers that name the balls over time; None where unknown.
    sources
        (N,) or one integer: which object each ball comes from, an index; None for one and the same.

    Attributes
    ----------
    bounds
        (2, 3) float64: the least and the greatest corner of the box around all influence spheres; zeros where there is none.
    weight
        That of all balls; None where they differ, or there is none.
    fastest
        The greatest speed, Blender units a second; 0 where unknown.
    dropped
        How many balls were unusable and left out, by reason (``{"position is not finite": 3}``).

    All arrays are float32 (ids, sources: int32), C-contiguous and read-only; float32 input that is whole is not copied.

    Raises
    ------
    InputError
        An array has the wrong shape or is not numeric.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        radii: npt.ArrayLike,
        weights: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        ids: npt.ArrayLike | None = None,
        sources: npt.ArrayLike | None = None,
    ) -> None:
        given = _numeric("positions", positions, np.float32)
        if given.size == 0:
            given = given.reshape(0, 3)
        if given.ndim != 2 or given.shape[1] != 3:
            raise InputError(f"positions must have the shape (N, 3), not {given.shape}")
        count = len(given)
        columns: dict[str, Any] = {
            "positions": given,
            "radii": _column("radii", radii, count, ()),
            "weights": _column("weights", 1.0 if weights is None else weights, count, ()),
            "colors": None if colors is None else _column("colors", colors, count, (3,)),
            "velocities": None if velocities is None else _column("velocities", velocities, count, (3,)),
            "ids": None if ids is None else _column("ids", ids, count, (), np.int32),
            "sources": None if sources is None else _column("sources", sources, count, (), np.int32),
        }
        usable, self.dropped = _usable(columns)
        for name, column in columns.items():
            if column is not None:
                column = column if usable is None else column[usable]
                column = np.ascontiguousarray(column).view()
                column.flags.writeable = False
            setattr(self, name, column)

    positions: FloatArray
    radii: FloatArray
    weights: FloatArray
    colors: FloatArray | None
    velocities: FloatArray | None
    ids: npt.NDArray[np.int32] | None
    sources: npt.NDArray[np.int32] | None
    dropped: dict[str, int]

    @cached_property
    def bounds(self) -> npt.NDArray[np.float64]:
        if not len(self):
            return np.zeros((2, 3))
        radii = self.radii[:, None]
        return np.array([(self.positions - radii).min(axis=0), (self.positions + radii).max(axis=0)], np.float64)

    @cached_property
    def weight(self) -> float | None:
        return float(self.weights[0]) if len(self) and np.all(self.weights == self.weights[0]) else None

    @cached_property
    def fastest(self) -> float:
        if self.velocities is None or not len(self):
            return 0.0
        return float(np.sqrt(np.max(np.einsum("ij,ij->i", self.velocities, self.velocities))))

    def with_colors(self, colors: npt.ArrayLike) -> Balls:
        """The same balls, of which all else is shared, with other colours: (N, 3) or one colour (3,), linear Rec.709."""
        column = np.ascontiguousarray(_column("colors", colors, len(self), (3,))).view()
        column.flags.writeable = False
        changed = copy(self)
        changed.colors = column
        return changed

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Balls({len(self)} balls, {sum(self.dropped.values())} dropped)"

    @property
    def dropped_text(self) -> str:
        """One sentence that says what was left out and why, empty where nothing was."""
        return dropped_text(self.dropped)


def dropped_text(dropped: dict[str, int]) -> str:
    """One sentence about balls that were left out, by their number for each reason; empty where none was."""
    if not dropped:
        return ""
    reasons = ", ".join(f"{count} whose {reason}" for reason, count in dropped.items())
    total = sum(dropped.values())
    return f"{total} {'ball was' if total == 1 else 'balls were'} left out: {reasons}"


def _numeric(name: str, values: npt.ArrayLike, dtype: type) -> npt.NDArray[Any]:
    try:
        # Overflow to infinity is found, counted and dropped later.
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(values).astype(dtype, order="C", copy=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}") from error


def _column(name: str, values: npt.ArrayLike, count: int, tail: tuple[int, ...], dtype: type = np.float32) -> npt.NDArray[Any]:
    """`values` as an array of the shape (count, *tail); one value is repeated."""
    array = _numeric(name, values, dtype)
    if array.shape == tail:
        return np.broadcast_to(array, (count, *tail))
    if array.shape != (count, *tail):
        raise InputError(f"{name} must have the shape {(count, *tail)} or {tail or 'of one number'}, not {array.shape}")
    return array


def _usable(columns: dict[str, Any]) -> tuple[npt.NDArray[np.bool_] | None, dict[str, int]]:
    """Mask of the usable balls (None: all), and how many are dropped by reason; the first reason counts."""
    radii = columns["radii"]
    checks = [
        ("position is not finite", _finite(columns["positions"])),
        ("radius is not finite", _finite(radii)),
        ("radius is not greater than zero", radii > 0),
        ("weight is not finite", _finite(columns["weights"])),
    ]
    usable = np.ones(len(radii), bool)
    dropped = {}
    for reason, passes in checks:
        bad = int(np.count_nonzero(usable & ~passes))
        if bad:
            dropped[reason] = bad
            usable &= passes
    return (usable if dropped else None), dropped


def _finite(values: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    finite: npt.NDArray[np.bool_] = np.isfinite(values)
    return finite if finite.ndim == 1 else finite[:, 0] & finite[:, 1] & finite[:, 2]
