"""The connected parts of a fluid, from Python."""

import numpy as np
import pytest

import meniscus

FIELD = meniscus.Field("wyvill", 0.4)


def test_drops_are_parts_of_their_own():
    block = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)
    drops = np.array([(20.0, 0, 0), (30, 0, 0), (30.5, 0, 0)])
    mist = np.array([(40.0, 0, 0)])
    positions = np.concatenate([drops, block, mist])
    weights = np.append(np.ones(len(positions) - 1), 0.3)
    found = meniscus.find_clusters(meniscus.Balls(positions, 1.5, weights), FIELD)
    np.testing.assert_array_equal(found.labels, [0, 1, 1, *[2] * len(block), -1])
    np.testing.assert_array_equal(found.sizes, [1, 2, len(block)])


def test_ways_between_parts_agree_with_the_oracle():
    """Two balls that are alone together are one liquid where a ray between their centres crosses no surface."""
    random = np.random.default_rng(4)
    for apart in random.uniform(0.5, 2.0, 40):
        balls = meniscus.Balls([(0, 0, 0), (apart, 0, 0)], random.uniform(0.6, 1.4, 2), random.uniform(0.6, 2.0, 2))
        t, _ = meniscus.oracle.cast(balls, FIELD, [(0, 0, 0)], [(1, 0, 0)])
        is_one = bool(t[0] > apart)
        assert (len(meniscus.find_clusters(balls, FIELD).sizes) == 1) == is_one


@pytest.mark.parametrize("threads", [1, 3])
def test_parts_are_the_same_for_any_number_of_threads(threads):
    positions = np.random.default_rng(1).random((5000, 3))
    balls = meniscus.Balls(positions, 0.03)
    found, expected = (meniscus.find_clusters(balls, FIELD, threads=count) for count in (threads, 2))
    assert 500 < len(found.sizes) < 5000
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.sizes, expected.sizes)
