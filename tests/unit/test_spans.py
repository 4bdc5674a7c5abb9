"""Spans: the parts of rays that lie in the fluid, beside closed forms and the oracle."""

from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.render.spans import find_spans
from meniscus.addon.render.surroundings import Backdrop

FIELD = meniscus.Field("quartic", 0.25)
R = 0.5 / np.sqrt(0.5)
"""Influence radius of a ball with a surface of the radius 0.5."""


def camera(width=33, height=33, **options):
    return meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), fov_y=0.4, width=width, height=height, **options)


def test_one_ball_is_as_thick_as_its_chords():
    view = camera()
    spans = find_spans(meniscus.Balls([(0, 0, 0)], R), view, FIELD)
    assert len(np.unique(spans.pixel)) == len(spans) > 200
    _, directions = view.view_rays()
    directions = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    # The distance of each ray from the ball's centre, which is 5 ahead.
    distance_2 = 25 * (1 - directions[..., 2] ** 2)
    expected = 2 * np.sqrt(np.maximum(0.25 - distance_2, 0))
    np.testing.assert_allclose(spans.thickness, expected, atol=2e-4)
    middle = spans.pixel == 16 * 33 + 16
    np.testing.assert_allclose((spans.enter[middle], spans.leave[middle]), [[4.5], [5.5]], atol=1e-6)
    np.testing.assert_allclose(spans.normal[middle], [[0, -1, 0]], atol=1e-5)


def test_two_balls_behind_one_another_are_two_spans():
    spans = find_spans(meniscus.Balls([(0, 2, 0), (0, 0, 0)], R), camera(), FIELD)
    middle = spans.pixel == 16 * 33 + 16
    np.testing.assert_allclose(spans.enter[middle], [4.5, 6.5], atol=1e-6)
    np.testing.assert_allclose(spans.leave[middle], [5.5, 7.5], atol=1e-6)
    assert np.all(np.diff(spans.pixel) >= 0)


@pytest.mark.parametrize(("clip", "expected"), [((5.2, 100), (5.2, 5.5)), ((0.1, 5.2), (4.5, 5.2)), ((4.9, 5.1), (4.9, 5.1))])
def test_spans_end_at_the_clip_distances(clip, expected):
    spans = find_spans(meniscus.Balls([(0, 0, 0)], R), camera(clip_start=clip[0], clip_end=clip[1]), FIELD)
    middle = spans.pixel == 16 * 33 + 16
    found = np.array([spans.enter[middle], spans.leave[middle]])
    np.testing.assert_allclose(found, np.array(expected)[:, None], atol=1e-6)


@pytest.mark.parametrize("is_perspective", [True, False])
def test_random_fluids_are_those_of_the_oracle(is_perspective):
    rng = np.random.default_rng(7)
    balls = meniscus.Balls(rng.uniform(-1, 1, (60, 3)), rng.uniform(0.2, 0.6, 60), rng.choice([1.0, 1.0, -0.5], 60))
    view = (
        camera(24, 18)
        if is_perspective
        else meniscus.Camera.orthographic((0, -5, 0), (0, 0, 0), scale=2.4, width=24, height=18)
    )
    spans = find_spans(balls, view, FIELD)
    origins, directions = view.view_rays()
    turn, shape = view.world_from_view[:3, :3], (-1, 3)
    origins, directions = (origins.reshape(shape) @ turn.T + view.eye, directions.reshape(shape) @ turn.T)
    rays, t, is_entering = meniscus.oracle.crossings(balls, FIELD, origins, directions)
    scale = np.linalg.norm(directions, axis=1)
    np.testing.assert_array_equal(spans.pixel, rays[is_entering])
    depths = t / scale[rays]
    np.testing.assert_allclose(spans.enter, depths[is_entering], atol=1e-5)
    np.testing.assert_allclose(spans.leave, depths[~is_entering], atol=1e-5)
    assert len(spans) > len(np.unique(spans.pixel)) > 200


def test_the_first_span_begins_where_the_depth_pass_is():
    rng = np.random.default_rng(3)
    balls, view = meniscus.Balls(rng.uniform(-1, 1, (300, 3)), 0.3), camera(40, 30)
    image = meniscus.render(balls, view, FIELD, passes=("depth", "thickness"))
    spans = find_spans(balls, view, FIELD)
    pixels, first = np.unique(spans.pixel, return_index=True)
    np.testing.assert_array_equal(pixels, np.flatnonzero(image.hit))
    np.testing.assert_allclose(spans.enter[first], image["depth"][image.hit], rtol=1e-6)
    np.testing.assert_array_equal(image["thickness"], spans.thickness)


def test_thickness_ends_at_what_hides_the_fluid():
    from meniscus.addon.render.renderer import render

    view = camera()
    backdrop = replace(Backdrop.empty(view), depth=np.full((33, 33), 4.8, np.float32), names=("Wall",))
    image = render(meniscus.Balls([(0, 0, 0)], R), view, FIELD, passes=("thickness",), backdrop=backdrop)
    assert image["thickness"][16, 16] == pytest.approx(0.3, abs=1e-5)
    assert not image["thickness"][0].any()


def test_no_fluid_has_no_spans():
    spans = find_spans(meniscus.Balls(np.empty((0, 3)), 1.0), camera(), FIELD)
    assert len(spans) == 0
    assert not spans.thickness.any()
