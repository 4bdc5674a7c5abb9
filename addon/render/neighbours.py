"""Which balls' influence spheres overlap (Mueller, Grottel and Ertl 2007, section 3.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from . import native

MOST_NEIGHBOURS = 2**31 - 1
"""Those that shaders can number."""


@dataclass(frozen=True, eq=False)
class Neighbours:
    """For each of N balls those whose influence spheres overlap its own: no other adds to the density there.

    Attributes
    ----------
    order
        (N,) uint32: the balls in an order of space, so that neighbours are near one another in memory too.
    starts
        (N + 1,) uint32: where the list of each place of that order begins, and where the last one ends.
    places
        (E,) uint32: the lists one after the other, as places in the order. The nearest neighbours come first; no ball is in
        its own list. Balls that touch to within rounding may be in each other's.
    origin
        (3,) float64, world space: positions less it are float32 without a loss.
    """

    order: npt.NDArray[np.uint32]
    starts: npt.NDArray[np.uint32]
    places: npt.NDArray[np.uint32]
    origin: npt.NDArray[np.float64]

    @property
    def counts(self) -> npt.NDArray[np.uint32]:
        """(N,): how many neighbours each place has."""
        return np.diff(self.starts)


def find_neighbours(
    balls: Balls,
    *,
    most: int = MOST_NEIGHBOURS,
    threads: int = 0,
    watch: Callable[[float], object] = native.let_interrupt,
) -> Neighbours:
    """Find the neighbours of all balls: ``|p_i - p_j| < R_i + R_j``, whatever their weights.

    Parameters
    ----------
    most
        How many there may be, each pair counted twice; they take four bytes each.
    threads
        0: one for each core.
    watch
        Is called with the share of the work that is done, 0 to 1; what it raises cancels.

    Raises
    ------
    InputError
        There are more than `most`; nothing was kept of them.
    DeviceError
        The native core is missing, or there is too little memory.
    """
    with native.translated_errors():
        order, starts, places, origin = native.load().find_neighbours(
            balls.positions, balls.radii, most=most, threads=threads, watch=watch
        )
    return Neighbours(order, starts, places, np.array(origin))
