"""Velocities of balls from where they are in other frames."""

import numpy as np
import pytest

from meniscus.addon.fluid.ball_motion import matched_positions, velocities_between

POSITIONS = np.array([(1, 0, 0), (2, 0, 0), (3, 0, 0)], np.float32)
NAN = np.full(3, np.nan, np.float32)


def ids(*numbers):
    return np.array(numbers, np.int32)


@pytest.mark.parametrize(
    ("own", "others", "order"),
    [
        (ids(5, -2, 9), ids(9, 5, 4), (1, None, 0)),
        (ids(5, 9), ids(9, 5, 4), (1, 0)),
        (ids(5, 5, 9), ids(9, 5, 4), (0, 1, 2)),  # ids that do not tell balls apart
        (ids(5, 6, 9), ids(9, 9, 9), (0, 1, 2)),
        (ids(5, 6, 9), None, (0, 1, 2)),
        (None, ids(9, 8, 7), (0, 1, 2)),
        (None, None, (0, 1, 2)),
    ],
)
def test_balls_are_found_by_id_else_by_order(own, others, order):
    found = matched_positions(len(order), own, POSITIONS, others)
    np.testing.assert_array_equal(found, [NAN if index is None else POSITIONS[index] for index in order])


@pytest.mark.parametrize("own", [None, ids(4, 4)])
def test_without_ids_another_number_of_balls_are_others(own):
    assert np.isnan(matched_positions(2, own, POSITIONS, ids(9, 5, 4))).all()


def test_differences_are_central_or_one_sided():
    now = np.zeros((4, 3), np.float32)
    before = np.array([(-1, 0, 0), (-1, 0, 2), NAN, NAN], np.float32)
    after = np.array([(3, 0, 0), NAN, (0, 3, 0), NAN], np.float32)
    expected = [(4, 0, 0), (2, 0, -4), (0, 6, 0), (0, 0, 0)]
    np.testing.assert_allclose(velocities_between(now, before, after, (0.5, 0.5)), expected)


def test_times_before_and_after_may_differ():
    """And now need not lie between them; at the same time as the only other one nothing is known."""
    now, before, after = (np.array([(x, 0, 0)] * 2, np.float32) for x in (1, 0, 4))
    before[1] = NAN
    np.testing.assert_allclose(velocities_between(now, before, after, (0.5, 1.5))[:, 0], [2, 2])
    np.testing.assert_allclose(velocities_between(now, before, after, (3.0, -1.0))[:, 0], [2, -3])
    np.testing.assert_allclose(velocities_between(now, before, after, (2.0, 0.0))[:, 0], [2, 0])
