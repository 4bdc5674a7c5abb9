"""The balls in the memory of the graphics processor, and the tables that go with a field."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.balls import Balls
from ....addon.fluid.field import Field
from ....addon.render.method import Attribute
from ...storage import Storage
from .programs import KERNEL_SHARES

_SHRINK = 0.998
"""Share by which kernel spheres are made smaller, so that the density at the distance found is above the isovalue by more than
rounding can hide."""

_COUNTS = 32
"""Balls of which it is known what the best of them must give."""


POSITION_BYTES = 12
"""Of a ball, in the largest of its buffers."""

_BINDINGS: dict[Attribute, int] = {"color": 13, "velocity": 14, "ball": 15}


@dataclass(frozen=True)
class BallBuffers:
    """Balls as the shaders read them: 16 bytes for each, more where weights differ or attributes are wanted.

    Attributes
    ----------
    balls
        What was uploaded.
    buffers
        By binding point.
    greatest_weight
        Of all balls.
    """

    balls: Balls
    buffers: dict[int, moderngl.Buffer]
    greatest_weight: float

    @classmethod
    def upload(
        cls,
        storage: Storage,
        balls: Balls,
        attributes: frozenset[Attribute],
        with_weights: bool,
        indices: npt.NDArray[np.int64] | None = None,
    ) -> BallBuffers:
        """Upload what is needed to find the attributes; `indices` are the balls' numbers where they are only some.

        Some may have the same weight where all have not: `with_weights` says what the shaders read.
        """
        arrays: dict[int, npt.NDArray[np.float32] | npt.NDArray[np.int32] | None] = {
            0: balls.positions,
            1: balls.radii,
            2: balls.weights if with_weights else None,
            13: balls.colors if "color" in attributes else None,
            14: balls.velocities if "velocity" in attributes else None,
        }
        if "ball" in attributes:
            numbers = np.arange(len(balls)) if indices is None else indices
            arrays[15] = numbers.astype(np.int32)
        buffers = {binding: storage.of(array) for binding, array in arrays.items() if array is not None}
        return cls(balls, buffers, float(balls.weights.max()))

    def has(self, attributes: frozenset[Attribute]) -> bool:
        """Whether what the attributes need was uploaded."""
        return all(_BINDINGS[name] in self.buffers for name in attributes)


@lru_cache
def kernel_shares(field: Field) -> npt.NDArray[np.float32]:
    """(KERNEL_SHARES + 1,) kernel radii as shares of influence radii: the least of those of all weights in a part of
    ``isovalue / weight`` from 0 to 1, of which the last has none.
    """
    ratios = np.arange(1, KERNEL_SHARES + 1) / KERNEL_SHARES
    shares = field.kernel_radii(np.ones(KERNEL_SHARES), field.threshold / ratios) * _SHRINK
    return np.append(shares, 0).astype(np.float32)


@lru_cache
def least_x(field: Field, greatest_weight: float) -> npt.NDArray[np.float32]:
    """(33,) by their number n: of n balls that together reach the isovalue one must have at least this x; 0 for more."""
    counts = np.maximum(np.arange(_COUNTS), 1)
    # A little lower, so that rounding cannot make it too high.
    needed = field.threshold * (1 - 1e-4) / (counts * greatest_weight) if greatest_weight > 0 else np.full(_COUNTS, np.nan)
    found = np.nan_to_num(field.density_kernel.inverse(needed), nan=1.0)
    return np.append(found, 0).astype(np.float32)
