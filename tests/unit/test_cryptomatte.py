"""Mattes: numbers of names, and which objects cover a pixel."""

import json

import numpy as np
import pytest

from meniscus.addon.fluid.cryptomatte import Coverage, float_bits, layer_names, name_hash


@pytest.mark.parametrize(("name", "number"), [("Cube", 0xA8FCE865), ("Light", 0xC77D43E5), ("object", 0x055EC73D)])
def test_numbers_are_those_that_cycles_writes(name, number):
    assert float_bits(name_hash(name)) == number


def test_hash_of_names_of_any_length():
    """Reference values of MurmurHash3_x86_32 with the seed 0."""
    assert [name_hash(name) for name in ("", "a", "aaaa", "Hello, world!")] == [0, 0x3C2569B2, 0x7EEED987, 0xC0363E43]


@pytest.mark.parametrize("number", [0, 0x007FFFFF, 0x7F800000, 0x7FC00001, 0x80000000, 0xFFFFFFFF])
def test_numbers_are_normal_floats(number):
    value = np.array([float_bits(number)], np.uint32).view(np.float32)[0]
    assert np.isfinite(value)
    assert abs(value) >= np.finfo(np.float32).tiny


def test_ranks_begin_with_the_object_that_covers_most():
    coverage = Coverage(6)
    names = ("Near", "Far", "Never")
    for objects in ([[0, -1, 1]], [[0, -1, 0]], [[1, -1, 1]], [[0, 1, 1]]):
        coverage.add(np.array(objects, np.int32), names)
    matte = coverage.cryptomatte((1, 3))
    near, far = (np.array([float_bits(name_hash(name))], np.uint32).view(np.float32)[0] for name in names[:2])
    np.testing.assert_array_equal(matte.ranks[0, 0, :6], [near, 0.75, far, 0.25, 0, 0])
    np.testing.assert_array_equal(matte.ranks[0, 1, :4], [far, 0.25, 0, 0])
    np.testing.assert_array_equal(matte.ranks[0, 2, :4], [far, 0.75, near, 0.25])
    assert list(matte.layers) == ["CryptoObject00", "CryptoObject01", "CryptoObject02"]
    np.testing.assert_array_equal(matte.layers["CryptoObject01"][0, 0], [0, 0, 0, 0])


def test_odd_numbers_of_objects_fill_whole_layers():
    assert [len(layer_names(levels)) for levels in (0, 1, 2, 3, 6)] == [0, 1, 1, 2, 3]
    assert Coverage(3).cryptomatte((2, 1)).ranks.shape == (2, 1, 8)


def test_the_header_names_all_objects():
    coverage = Coverage(2)
    coverage.add(np.full((1, 1), -1, np.int32), ("Cube", "Wäßrig"))
    header = coverage.cryptomatte((1, 1)).metadata("ViewLayer")
    assert header["cryptomatte/542cafa/name"] == "ViewLayer.CryptoObject"
    manifest = json.loads(header["cryptomatte/542cafa/manifest"])
    assert manifest["Cube"] == "a8fce865"
    assert set(manifest) == {"Cube", "Wäßrig"}
