"""Liquids by number: the pass, the colours and the counts."""

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.lighting import FluidSource
from meniscus.addon.fluid.palette import UNNUMBERED, numbered_colors
from meniscus.addon.render import cluster_numbers

FIELD = meniscus.Field("wyvill", 0.4)
# A lone ball, a ball too thin to be fluid, three in a row, two together.
POSITIONS = np.array([(-4.0, 0, 0), (-2, 0, 0), (0, 0, 0), (0.5, 0, 0), (1, 0, 0), (4, 0, 0), (4.5, 0, 0)])
WEIGHTS = np.array([1, 0.2, 1, 1, 1, 1, 1])
NUMBERS = [3, 0, 1, 1, 1, 2, 2]
COUNTS = {"clusters": 3, "largest_cluster": 3, "lone_droplets": 1}


def balls(**columns):
    return meniscus.Balls(POSITIONS, 1.0, WEIGHTS, **columns)


def image_of(fluid, **options):
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=3, width=121, height=31)
    return meniscus.render(fluid, camera, FIELD, backend="cpu", **options)


def test_the_largest_liquid_is_the_first_and_of_equals_that_of_the_first_ball():
    found = cluster_numbers.number_clusters(balls(), FIELD)
    assert found.numbers.tolist() == NUMBERS
    assert found.sizes.tolist() == [3, 2, 1]
    assert found.counts == COUNTS
    pairs = meniscus.Balls([(0, 0, 0), (5, 0, 0), (0.5, 0, 0), (5.5, 0, 0)], 1.0)
    assert cluster_numbers.number_clusters(pairs, FIELD).numbers.tolist() == [1, 2, 1, 2]


def test_no_balls_have_no_liquid():
    found = cluster_numbers.number_clusters(meniscus.Balls(np.zeros((0, 3)), 1.0), FIELD)
    assert found.counts == {"clusters": 0, "largest_cluster": 0, "lone_droplets": 0}
    thin = cluster_numbers.number_clusters(meniscus.Balls([(0, 0, 0)], 1.0, 0.1), FIELD)
    assert (thin.numbers.tolist(), thin.counts["clusters"]) == ([0], 0)


def test_the_pass_is_the_number_of_the_ball_seen():
    fluid = balls()
    image = image_of(fluid, passes=("cluster_id", "ball_id", "depth"))
    numbers = cluster_numbers.number_clusters(fluid, FIELD).numbers
    expected = np.where(image.hit, numbers[np.maximum(image["ball_id"], 0).astype(int)], -1)
    np.testing.assert_array_equal(image["cluster_id"], expected)
    assert set(np.unique(image["cluster_id"])) == {-1, 1, 2, 3}
    assert image.info.counts.items() >= COUNTS.items()


def test_a_ball_of_no_liquid_that_shows_itself_has_the_number_0():
    # A ball a little too thin for fluid at its centre swells another's surface.
    fluid = meniscus.Balls([(0, 0, 0), (1.1, 0, 0)], 1.0, [1.0, 0.39])
    numbers = cluster_numbers.number_clusters(fluid, FIELD).numbers
    assert numbers.tolist() == [1, 0]
    camera = meniscus.Camera.orthographic((0, -4, 0), (0.6, 0, 0), scale=2, width=201, height=41)
    image = meniscus.render(fluid, camera, FIELD, backend="cpu", passes=("cluster_id", "ball_id"))
    ball = image["ball_id"]
    np.testing.assert_array_equal(image["cluster_id"], np.select([ball == 0, ball == 1], [1.0, 0.0], -1.0))


def test_a_holdout_has_the_background():
    look = meniscus.Look("flat", sources=(FluidSource("A"), FluidSource("B", is_holdout=True)))
    fluid = balls(sources=[0, 0, 0, 0, 0, 1, 1])
    image = image_of(fluid, passes=("cluster_id",), look=look)
    assert set(np.unique(image["cluster_id"])) == {-1, 1, 3}


def test_clusters_are_found_once_for_the_same_balls(monkeypatch):
    calls = []
    find = cluster_numbers.find_clusters
    monkeypatch.setattr(cluster_numbers, "find_clusters", lambda *given, **named: calls.append(1) or find(*given, **named))
    fluid = balls()
    image_of(fluid, passes=("cluster_id",))
    colored = meniscus.colored_by_cluster(fluid, FIELD)
    assert meniscus.colored_by_cluster(fluid, FIELD) is colored
    image = image_of(colored, passes=("cluster_id", "color"))
    assert len(calls) == 1
    assert image.info.counts.items() >= COUNTS.items()
    cluster_numbers.number_clusters(fluid, meniscus.Field("wyvill", 0.3))
    assert len(calls) == 2


def test_counts_are_not_made_for_those_who_do_not_ask():
    assert "clusters" not in image_of(balls(), passes=("ball_id", "depth")).info.counts


def test_balls_have_the_colours_of_their_liquids():
    fluid = balls(velocities=np.ones((7, 3)), ids=np.arange(7))
    colored = meniscus.colored_by_cluster(fluid, FIELD)
    np.testing.assert_array_equal(colored.colors, numbered_colors(np.array(NUMBERS)))
    assert not colored.colors.flags.writeable
    assert fluid.colors is None
    assert all(
        getattr(colored, name) is getattr(fluid, name) for name in ("positions", "radii", "weights", "velocities", "ids")
    )
    flat = meniscus.Look("flat")
    image = image_of(colored, passes=("combined", "cluster_id"), look=flat)
    for number in (1, 2, 3):
        seen = image["combined"][image["cluster_id"] == number][:, :3]
        np.testing.assert_allclose(seen, np.broadcast_to(numbered_colors(np.array([number])), seen.shape), atol=1e-6)


def test_only_the_sources_that_ask_for_it_take_the_colours():
    fluid = balls(sources=[0, 0, 0, 0, 1, 1, 1], colors=(0.25, 0.5, 0.75))
    colored = meniscus.colored_by_cluster(fluid, FIELD, sources=[1])
    np.testing.assert_array_equal(colored.colors[:4], [(0.25, 0.5, 0.75)] * 4)
    # Liquids do not end where objects do.
    np.testing.assert_array_equal(colored.colors[4:], numbered_colors(np.array([1, 2, 2])))
    with pytest.raises(InputError, match="colors must have the shape"):
        fluid.with_colors(np.zeros((3, 3)))


def test_colours_keep_to_their_numbers_and_are_told_apart():
    numbers = np.arange(200)
    colors = numbered_colors(numbers)
    np.testing.assert_array_equal(colors[0], np.float32(UNNUMBERED))
    np.testing.assert_array_equal(numbered_colors(numbers[::-3]), colors[::-3])
    assert colors.dtype == np.float32
    assert 0 <= colors.min() <= colors.max() <= 1
    encoded = np.where(colors <= 0.0031308, colors * 12.92, 1.055 * colors ** (1 / 2.4) - 0.055)
    apart = np.linalg.norm(encoded[:, None] - encoded[None], axis=2) + 9 * np.eye(200)
    # Orange and vermilion are the nearest of the first ones.
    assert apart[:8, :8].min() > 0.25
    # Neighbouring numbers too.
    assert np.min(np.linalg.norm(np.diff(encoded, axis=0), axis=1)) > 0.15
    assert apart.min() > 0.01
