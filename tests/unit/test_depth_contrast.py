"""Depth contrast: the blur, the spatial importance and what it does to the Combined pass."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.camera import Region
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.depth_contrast import BACKGROUND_GAP, blurred_rows, spatial_importance

PROJECTIONS = ("perspective", "orthographic")
# One in front of the other, and both in front of nothing.
BALLS = meniscus.Balls([[0, -1, 0], [0.6, 1, 0.2]], [0.9, 1.3])


def camera(projection, width=64, height=48):
    if projection == "perspective":
        return meniscus.Camera.perspective((0, -6, 0), (0, 0, 0), fov_y=0.5, width=width, height=height)
    return meniscus.Camera.orthographic((0, -6, 0), (0, 0, 0), scale=3.0, width=width, height=height)


def importance(depth, radius=0.05, projection="orthographic", hit=None):
    depth = np.asarray(depth, np.float32)
    hit = np.ones(depth.shape, bool) if hit is None else hit
    return spatial_importance(depth, hit, camera(projection, *depth.shape[::-1]), radius)


def headlight(**settings):
    return meniscus.Look(style="headlight", **settings)


def combined(look, projection="perspective", view=None, **options):
    options = {"method": "tile_caster", "passes": ("combined",), "look": look, **options}
    return meniscus.render(BALLS, view or camera(projection), meniscus.Field(), **options)["combined"]


@pytest.mark.parametrize("sigma", [0.01, 0.3, 1.0, 2.7, 15.0, 60.0])
def test_blur_of_an_impulse_has_the_sum_the_middle_and_the_variance_of_the_gaussian(sigma):
    image = np.zeros((2, 1201))
    image[0, 600] = 1
    blurred = blurred_rows(image, sigma)
    offsets = np.arange(1201) - 600
    assert not blurred[1].any()
    assert blurred.min() >= -1e-14
    moments = [float(np.sum(blurred[0] * offsets**power)) for power in range(3)]
    np.testing.assert_allclose(moments, [1, 0, sigma**2], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("sigma", [2.7, 15.0, 60.0])
def test_blur_of_an_impulse_is_nearly_the_gaussian(sigma):
    image = np.zeros((1, 1201))
    image[0, 600] = 1
    offsets = np.arange(1201) - 600
    gaussian = np.exp(-0.5 * (offsets / sigma) ** 2) / (sigma * math.sqrt(2 * math.pi))
    np.testing.assert_allclose(blurred_rows(image, sigma)[0], gaussian, atol=0.065 * gaussian.max())


@pytest.mark.parametrize("width", [1, 2, 7, 300])
@pytest.mark.parametrize("sigma", [1e-9, 0.7, 5.0, 1e6])
def test_blur_keeps_a_constant_up_to_the_edges_and_stays_within_what_there_is(width, sigma):
    np.testing.assert_allclose(blurred_rows(np.full((3, width), 0.7), sigma), 0.7, rtol=1e-12)
    row = np.random.default_rng(3).random((1, width))
    blurred = blurred_rows(row, sigma)
    assert row.min() - 1e-12 <= blurred.min() <= blurred.max() <= row.max() + 1e-12
    if sigma == 1e6:
        np.testing.assert_allclose(blurred, row.mean(), rtol=1e-12)


@pytest.mark.parametrize("is_transposed", [False, True])
def test_step_in_depth_is_lit_in_front_and_dark_behind_as_the_gaussian_says(is_transposed):
    depth = np.full((200, 200), 3.0)
    depth[:, 100:] = 5.0
    result = importance(depth.T if is_transposed else depth)
    row = (result.T if is_transposed else result)[57]
    sigma = 0.05 * 200
    behind = np.array([0.5 * math.erfc((n + 0.5) / (sigma * math.sqrt(2))) for n in range(100)])
    np.testing.assert_allclose(row[100:], -behind, atol=0.01)
    np.testing.assert_allclose(row[:100], behind[::-1], atol=0.01)
    assert row[99] > 0.45
    assert row[100] < -0.45


def test_silhouettes_stand_out_from_a_background_a_little_behind_the_farthest_surface():
    depth = np.full((90, 120), 1e10, np.float32)
    depth[:, :40], depth[:, 40:80] = 2.0, 4.0
    row = importance(depth, radius=0.03, hit=depth < 1e10)[45]
    # What the blur leaves between neighbours at a step is the peak of the Gaussian.
    left = 1 - 1 / (0.03 * 90 * math.sqrt(2 * math.pi))
    np.testing.assert_allclose([row[39] - row[40], row[79] - row[80]], [left, left * BACKGROUND_GAP], rtol=0.02)
    assert row[79] > 0 > row[80]


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_constant_depth_changes_nothing(projection):
    assert not importance(np.full((48, 64), 7.25), projection=projection).any()
    assert not importance([[7.25]], projection=projection).any()


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_nothing_seen_changes_nothing(projection):
    assert not importance(np.full((48, 64), 1e10), projection=projection, hit=np.zeros((48, 64), bool)).any()


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_rounding_errors_of_a_flat_wall_are_not_stretched(projection):
    noise = 1e-6 * np.random.default_rng(4).random((48, 64))
    assert np.abs(importance(7 + noise, projection=projection)).max() < 1e-4


@pytest.mark.parametrize(("projection", "farthest"), [("orthographic", 3.0), ("perspective", 4.0)])
def test_gaps_that_look_alike_are_changed_alike_in_an_image(projection, farthest):
    depth = np.full((60, 180), 1.0)
    depth[:, 60:120], depth[:, 120:] = 2.0, farthest
    row = importance(depth, projection=projection)[30]
    np.testing.assert_allclose(row[30:90], row[90:150], atol=1e-6)
    assert row[59] > 0.2 > -0.2 > row[60]


def test_what_looks_alike_is_changed_alike_at_any_distance():
    depth = 3 + np.random.default_rng(5).random((48, 64))
    np.testing.assert_allclose(importance(depth + 50), importance(depth), atol=1e-4)
    near, far = (importance(depth * scale, projection="perspective") for scale in (1, 40))
    np.testing.assert_allclose(far, near, atol=1e-5)
    assert np.abs(near).max() > 0.3


def test_depth_of_zero_is_only_very_near():
    depth = np.full((48, 64), 5.0)
    depth[20, 30] = 0
    result = importance(depth, projection="perspective")
    assert np.all(np.isfinite(result))
    assert result[20, 30] > 0.9


def test_zero_leaves_the_light_as_it_is():
    bare = combined(headlight())
    assert bare[..., :3].max() > 0.3
    np.testing.assert_array_equal(combined(headlight(depth_contrast=0, depth_contrast_radius=0.5)), bare)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_light_changes_by_the_bounded_importance_and_alpha_stays(projection):
    look = headlight(color=(8.0, 0.5, 0.0), depth_contrast=2.5)
    passes = ("depth", "combined")
    image = meniscus.render(BALLS, camera(projection), meniscus.Field(), method="tile_caster", passes=passes, look=look)
    plain, changed = combined(replace(look, depth_contrast=0.0), projection), image["combined"]
    factor = 1 + np.tanh(2.5 * spatial_importance(image["depth"], image.hit, image.camera, look.depth_contrast_radius))
    np.testing.assert_allclose(changed[..., :3], plain[..., :3] * factor[..., None], rtol=1e-5, atol=1e-7)
    np.testing.assert_array_equal(changed[..., 3], plain[..., 3])
    assert not changed[~image.hit].any()
    assert changed.min() == 0
    assert np.any(changed[..., 0] > 1.2 * plain[..., 0])
    assert np.any(changed[..., 0] < 0.8 * plain[..., 0])


def test_the_greatest_contrast_ends_at_black_and_at_twice_the_light():
    plain, changed = combined(headlight()), combined(headlight(depth_contrast=100.0))
    assert changed.dtype == np.float32
    assert np.all(changed >= 0)
    assert np.all(changed[..., :3] <= 2.00001 * plain[..., :3])
    assert np.any(changed[..., 2] > 1.99 * plain[..., 2])


def test_preview_looks_like_the_final_image():
    look = headlight(ambient=1.0, depth_contrast=2.0)
    small = combined(look)[..., 2]
    large = combined(look, view=camera("perspective", 256, 192))[..., 2]
    # Away from outlines, where pixels of the small image are surface as a whole.
    blocks = large.reshape(48, 4, 64, 4)
    whole = blocks.min(axis=(1, 3)) > 0
    assert whole.sum() > 300
    difference = np.abs(blocks.mean(axis=(1, 3)) - small)[whole]
    assert np.percentile(difference, 95) < 0.02
    assert np.ptp(small[whole]) > 0.3


def test_blur_is_round_where_pixels_are_not():
    square = camera("orthographic", 120, 120)
    depth = np.full((120, 120), 2.0, np.float32)
    depth[:, 60:] = 3.0
    hit = np.ones_like(depth, bool)
    wide = spatial_importance(depth[:, ::4], hit[:, ::4], replace(square, width=30, pixel_aspect=4.0), 0.1)
    exact = spatial_importance(depth, hit, square, 0.1)
    np.testing.assert_allclose(wide, exact.reshape(120, 30, 4).mean(axis=2), atol=0.01)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_region_is_enhanced_like_an_image_of_its_own_with_the_radius_of_the_whole(projection):
    view = replace(camera(projection), region=Region(20, 12, 50, 36))
    part = combined(headlight(depth_contrast=3.0, depth_contrast_radius=0.05), view=view)
    own = combined(headlight(depth_contrast=3.0, depth_contrast_radius=0.1), view=view.cropped())
    np.testing.assert_allclose(part[12:36, 20:50], own, rtol=1e-5, atol=1e-6)


def test_region_is_the_same_part_of_the_whole_image_where_it_shows_the_range_and_the_surroundings():
    look = headlight(depth_contrast=3.0, depth_contrast_radius=0.02)
    whole = combined(look)
    rows, columns = (np.flatnonzero(whole[..., 3].any(axis=axis)) for axis in (1, 0))
    # The blur reaches three pixels here.
    region = Region(int(columns[0]) - 4, int(rows[0]) - 4, int(columns[-1]) + 5, int(rows[-1]) + 5)
    assert region.x_min > 0
    assert region.y_min > 0
    part = combined(look, view=replace(camera("perspective"), region=region))
    np.testing.assert_allclose(part, whole, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_image_without_balls_and_image_of_one_pixel(projection):
    look = headlight(depth_contrast=3.0)
    assert not combined(look, view=replace(camera(projection), region=Region(0, 0, 2, 2))).any()
    pixel = camera(projection, 1, 1)
    np.testing.assert_array_equal(combined(look, view=pixel), combined(headlight(), view=pixel))
    assert combined(look, view=pixel)[0, 0, 3] == 1


@pytest.mark.parametrize("value", [-0.1, 100.5, math.nan, math.inf])
def test_unusable_contrast_is_refused(value):
    with pytest.raises(InputError, match="depth contrast must be from 0"):
        meniscus.Look(depth_contrast=value)


@pytest.mark.parametrize("value", [0.0, -0.1, 1.5, math.nan, math.inf])
def test_unusable_radius_is_refused(value):
    with pytest.raises(InputError, match="radius of the depth contrast must be greater than 0"):
        meniscus.Look(depth_contrast_radius=value)
