"""Which influence spheres overlap, from Python."""

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.neighbours import find_neighbours


def lists_of(found):
    """The balls in each ball's list, as sets."""
    lists = {}
    for place, ball in enumerate(found.order):
        places = found.places[found.starts[place] : found.starts[place + 1]]
        assert len(np.unique(places)) == len(places)
        lists[int(ball)] = set(found.order[places].tolist())
    return lists


@pytest.mark.parametrize("spread", [1.0, 0.3, 1e-3])
def test_lists_are_those_of_all_pairs(spread):
    random = np.random.default_rng(3)
    radii = (0.2 * spread ** random.random(900)).astype(np.float32)
    balls = meniscus.Balls(random.random((900, 3)) * [1, 2, 3], radii, random.uniform(-1, 1, 900))
    apart = np.linalg.norm(balls.positions[:, None].astype(float) - balls.positions[None], axis=-1)
    overlaps = apart < radii[:, None].astype(float) + radii[None]
    np.fill_diagonal(overlaps, False)
    lists = lists_of(find_neighbours(balls))
    assert overlaps.sum() > 600
    assert lists == {ball: set(np.flatnonzero(row).tolist()) for ball, row in enumerate(overlaps)}


def test_balls_in_the_order_of_space_lie_near_one_another():
    positions = np.random.default_rng(4).random((20_000, 3))
    found = find_neighbours(meniscus.Balls(positions, 0.04))
    np.testing.assert_array_equal(np.sort(found.order), np.arange(20_000))
    steps = np.linalg.norm(np.diff(positions[found.order], axis=0), axis=1)
    assert np.median(steps) < 0.15 < 0.5 * np.median(np.linalg.norm(np.diff(positions, axis=0), axis=1))


def test_none_one_and_many_in_one_place():
    assert len(find_neighbours(meniscus.Balls(np.zeros((0, 3)), 1.0)).places) == 0
    alone = find_neighbours(meniscus.Balls([[1, 2, 3]], 1.0))
    np.testing.assert_array_equal(alone.starts, [0, 0])
    together = find_neighbours(meniscus.Balls(np.ones((500, 3)), 1.0))
    assert np.all(together.counts == 499)


def test_more_than_there_may_be_is_an_error_that_says_what_to_do():
    balls = meniscus.Balls(np.ones((30_000, 3)), 1.0)
    with pytest.raises(InputError, match=r"overlap in more than 1000000 places.*use fewer balls, or smaller radii"):
        find_neighbours(balls, most=1_000_000)


def test_what_the_watcher_raises_ends_the_search():
    def give_up(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        find_neighbours(meniscus.Balls(np.ones((10, 3)), 1.0), watch=give_up)


def test_positions_less_the_origin_lose_nothing():
    positions = (np.random.default_rng(5).random((100, 3)) + [1e5, -3e4, 0]).astype(np.float32)
    origin = find_neighbours(meniscus.Balls(positions, 1.0)).origin
    exact = positions.astype(np.float64) - origin
    np.testing.assert_array_equal(exact.astype(np.float32), exact)
    assert np.abs(exact[:, 0]).max() < 2
