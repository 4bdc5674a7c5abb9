"""Many vectors through one matrix."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

Real = TypeVar("Real", np.float32, np.float64)


def turned(vectors: npt.NDArray[Real], matrix: npt.NDArray[Real]) -> npt.NDArray[Real]:
    """`vectors` (N, 3) times `matrix` (3, 3), of the same dtype.

    Not by ``@``: a library of linear algebra gives such a product to threads of its own, which then wait in a loop for more
    and take the cores from whoever works next.
    """
    product = np.empty((len(vectors), 3), vectors.dtype)
    x, y, z = vectors.T
    for axis in range(3):
        product[:, axis] = x * matrix[0, axis] + y * matrix[1, axis] + z * matrix[2, axis]
    return product
