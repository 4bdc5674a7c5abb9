"""Which balls are one liquid (Mueller, Grottel and Ertl 2007 colour such clusters)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.field import Field
from . import native

NO_CLUSTER = -1
"""The label of a ball whose centre is not in the fluid."""


class Clusters(NamedTuple):
    """The connected parts of a fluid.

    Attributes
    ----------
    labels
        (N,) int32: the part of each ball, or NO_CLUSTER. Parts are numbered in the order of their first balls.
    sizes
        (C,) uint32: how many balls each part has.
    """

    labels: npt.NDArray[np.int32]
    sizes: npt.NDArray[np.uint32]


def find_clusters(
    balls: Balls, field: Field, *, threads: int = 0, watch: Callable[[float], object] = native.let_interrupt
) -> Clusters:
    """Find the connected parts of a fluid: two balls are in one where the straight way between their centres lies within it,
    or a chain of such ways does.

    Parameters
    ----------
    threads
        0: one for each core.
    watch
        Is called with the share of the work that is done, 0 to 1; what it raises cancels.

    Raises
    ------
    DeviceError
        The native core is missing, or there is too little memory.
    """
    with native.translated_errors():
        return Clusters(*native.load().find_clusters(*native.fluid_arguments(balls, field), threads=threads, watch=watch))
