"""What lib/fitted_bvh.glsl must know before it is compiled."""

from __future__ import annotations

from dataclasses import dataclass

from ..addon.fluid.kernels import PolynomialKernel
from .kernel_constants import kernel_constants

GREATEST_DEPTH = 96
"""Inner nodes above a leaf; the native core builds no deeper tree, so the stack holds whatever waits."""

MET_LENGTH = 16
"""Balls that a stretch of a ray meets in a leaf, for which there is room; more are computed anew at each step."""

# Loops end by what they do; these numbers only keep a faulty driver from looping for ever.
_MOST = {"MOST_ENTRIES": "0x7fffffffu", "MOST_VISITS": "1000000u", "MOST_STEPS": "1000000u"}


@dataclass(frozen=True)
class TreeVariant:
    """What the shaders depend on.

    Attributes
    ----------
    with_storage
        Whether the tree lies in storage buffers, else in buffer textures.
    with_weights
        Whether the balls' weights differ.
    overlaps
        Whether the tree's nodes do.
    """

    with_storage: bool
    with_weights: bool = False
    overlaps: bool = False

    def constants(self, kernel: PolynomialKernel) -> dict[str, object]:
        """The constants by name."""
        return {
            **kernel_constants(kernel),
            **_MOST,
            "WITH_STORAGE": int(self.with_storage),
            "WITH_WEIGHTS": int(self.with_weights),
            "OVERLAPS": int(self.overlaps),
            "STACK_LENGTH": GREATEST_DEPTH,
            "MET_LENGTH": MET_LENGTH,
        }
