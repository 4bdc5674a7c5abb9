"""The mean of a pixel's samples, and what else is counted over them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..fluid.cryptomatte import Coverage
from ..fluid.image import ImageBuffers
from ..fluid.passes import PASSES


class SampleMean:
    """Adds up images of one view whose rays lie differently in their pixels.

    Parameters
    ----------
    coverage
        Counts the objects; None where nobody asks for them.
    """

    def __init__(self, coverage: Coverage | None = None) -> None:
        self._coverage = coverage
        # The first image's own arrays as long as there is but one.
        self._sums: dict[str, npt.NDArray[np.float32]] = {}
        self._count = 0

    def add(self, image: ImageBuffers, names: tuple[str, ...]) -> None:
        """Add the antialiased passes of an image; `names` are those of the objects that may be seen."""
        self._count += 1
        for name, pixels in image.passes.items():
            if PASSES[name].is_antialiased:
                if self._count == 1:
                    self._sums[name] = pixels
                elif self._count == 2:
                    self._sums[name] = self._sums[name] + pixels
                else:
                    self._sums[name] += pixels
        if self._coverage is not None and image.objects is not None:
            self._coverage.add(image.objects, names)

    def put_into(self, image: ImageBuffers) -> None:
        """Give an image of the view the means."""
        for name, total in self._sums.items():
            image.passes[name] = total if self._count == 1 else total / np.float32(self._count)
        if self._coverage is not None:
            image.cryptomatte = self._coverage.cryptomatte(image.hit.shape)
