"""Vectors through a matrix."""

import numpy as np

from meniscus.addon.fluid.turning import turned


def test_rows_are_turned_as_by_the_matrix_product():
    random = np.random.default_rng(3)
    matrix = random.normal(size=(3, 3)).astype(np.float32)
    strided = random.normal(size=(50, 7)).astype(np.float32)[:, 2:5]
    product = turned(strided, matrix)
    np.testing.assert_allclose(product, strided.astype(float) @ matrix.astype(float), atol=1e-5)
    assert product.dtype == np.float32
    assert product.flags.c_contiguous
    assert turned(strided.astype(float), matrix.astype(float)).dtype == np.float64
    assert turned(strided[:0], matrix).shape == (0, 3)
