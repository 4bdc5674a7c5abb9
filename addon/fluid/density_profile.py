"""Density kernels that the user gives as a table."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .kernels import LEAST_SHARE, Kernel

MOST_DENSITIES = 1024
"""The width that OpenGL guarantees of a texture."""


@dataclass(frozen=True, init=False)
class DensityProfile(Kernel):
    """A kernel of one's own, for :class:`field.Field`: only methods that sample draw it.

    Parameters
    ----------
    densities
        (n,) the density of a ball of weight 1 at evenly spaced distances from its centre (first) to its influence radius (last,
        which is 0); linear between. They fall, or stay, from each to the next. n is from 2 to MOST_DENSITIES.

    Raises
    ------
    InputError
        These are no such densities.
    """

    densities: tuple[float, ...]

    def __init__(self, densities: npt.ArrayLike) -> None:
        try:
            table = np.asarray(densities, np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"A density profile must be an array of numbers: {error}") from error
        if table.ndim != 1 or not 2 <= len(table) <= MOST_DENSITIES:
            raise InputError(f"A density profile must be a row of 2 to {MOST_DENSITIES} numbers, not of shape {table.shape}")
        if not np.isfinite(table).all():
            raise InputError("A density profile must be finite everywhere: replace its NaNs and infinities by numbers")
        if table[-1] != 0:
            raise InputError(f"A density profile must end at 0, where the influence of a ball ends, not at {table[-1]:g}")
        if np.any(np.diff(table) > 0) or table[0] <= 0:
            raise InputError("A density profile must fall from the centre of a ball outwards, from above 0 and without rising")
        described = {"name": "profile", "label": "Profile", "description": "Densities from a table"}
        for name, value in {**described, "densities": tuple(table.tolist())}.items():
            object.__setattr__(self, name, value)

    @property
    def _table(self) -> npt.NDArray[np.float64]:
        return np.array(self.densities)

    @property
    def _distances(self) -> npt.NDArray[np.float64]:
        return np.linspace(0, 1, len(self.densities), dtype=np.float64)

    def value(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.value`."""
        return np.asarray(np.interp(np.sqrt(1 - np.clip(x, 0, 1)), self._distances, self._table))

    def derivative(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """See :meth:`Kernel.derivative`: that of the line from the entry before to the one behind."""
        s: npt.NDArray[np.float64] = np.sqrt(1 - np.clip(x, 0, 1)).astype(np.float64)
        steps = len(self.densities) - 1
        slopes = np.diff(self._table) * steps
        entry = np.clip((s * steps).astype(np.int64), 0, steps - 1)
        return np.where(np.asarray(x) > 0, -slopes[entry] / (2 * np.maximum(s, LEAST_SHARE)), 0)

    def inverse(self, density: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """See :meth:`Kernel.inverse`; reachable is what the table has."""
        target = np.asarray(density, np.float64)
        reachable = (target >= 0) & (target <= self.densities[0])
        s = np.interp(np.where(reachable, target, 0), self._table[::-1], self._distances[::-1])
        return np.where(reachable, 1 - s**2, np.nan)

    @property
    def content(self) -> float:
        """See :meth:`Kernel.content`."""
        # Simpson's rule is exact for the cubic 4 pi s^2 f between two entries.
        steps = len(self.densities) - 1
        s = np.linspace(0, 1, 2 * steps + 1)
        heights = 4 * math.pi * s**2 * np.interp(s, self._distances, self._table)
        return float(np.sum(heights[:-1:2] + 4 * heights[1::2] + heights[2::2]) / (6 * steps))

    @property
    def steepest_slope(self) -> float:
        """See :meth:`Kernel.steepest_slope`."""
        return float(np.max(-np.diff(self._table)) * (len(self.densities) - 1))
