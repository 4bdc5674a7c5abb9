"""Groups of balls for occlusion queries: what is drawn for a group must cover all its balls, and be nearer than they are."""

from __future__ import annotations

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.view_balls import view_balls
from meniscus.gpu_shaders.methods.depth_peeling.balls import in_spatial_order
from meniscus.gpu_shaders.methods.depth_peeling.groups import LEAST_BALLS, MAX_GROUPS, ball_groups, spatial_order

DEPTH_SCALE = 1 / 64


def seen_balls(camera: meniscus.Camera, count: int = 3000, seed: int = 0):
    """Balls around the eye as well as before it, in spatial order."""
    random = np.random.default_rng(seed)
    positions = random.uniform(-2, 2, (count, 3))
    balls = meniscus.Balls(positions, random.uniform(0.01, 0.4, count))
    return in_spatial_order(view_balls(balls, camera, meniscus.Field()))


CAMERAS = {
    "perspective": meniscus.Camera.perspective((0.1, -1.2, 0.2), (0, 0, 0), fov_y=1.2, width=96, height=72, clip_start=0.01),
    "orthographic": meniscus.Camera.orthographic((0, -4, 0), (0, 0.1, 0), scale=3.0, width=96, height=72),
}


def test_spatial_order_is_a_permutation_that_brings_neighbours_together():
    points = np.random.default_rng(1).random((5000, 3))
    order = spatial_order(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(5000))
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    assert np.median(steps) < 0.2 * np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))


def test_spatial_order_of_points_in_one_place():
    np.testing.assert_array_equal(spatial_order(np.ones((4, 3))), np.arange(4))


@pytest.mark.parametrize("count", [1, LEAST_BALLS, LEAST_BALLS + 1, MAX_GROUPS * LEAST_BALLS + 1])
def test_groups_hold_every_ball_once(count):
    camera = CAMERAS["orthographic"]
    positions = np.random.default_rng(2).uniform(-1, 1, (count, 3))
    balls = in_spatial_order(view_balls(meniscus.Balls(positions, 0.05), camera, meniscus.Field()))
    groups = ball_groups(balls)
    assert groups.starts[0] == 0
    assert groups.starts[-1] == len(balls) == count
    assert np.all(np.diff(groups.starts) > 0)
    assert len(groups.starts) - 1 <= MAX_GROUPS


@pytest.mark.parametrize("projection", CAMERAS)
def test_rectangles_cover_their_balls_and_are_nearer(projection):
    camera = CAMERAS[projection]
    balls = seen_balls(camera)
    groups = ball_groups(balls)
    corners = groups.corners(camera, DEPTH_SCALE)
    random = np.random.default_rng(3)
    window = camera.window
    behind = 0
    for index, (begin, end) in enumerate(zip(groups.starts[:-1], groups.starts[1:], strict=True)):
        # Points all over the spheres, those before the eye as they are seen.
        towards = random.normal(size=(end - begin, 40, 3))
        points = balls.centers[begin:end, None] + balls.radii[begin:end, None, None] * (
            towards / np.linalg.norm(towards, axis=2, keepdims=True)
        )
        points = points.reshape(-1, 3)
        behind += np.count_nonzero(points[:, 2] > 0)
        points = points[points[:, 2] < -1e-3]
        planar = -points[:, 2] if camera.is_perspective else np.ones(len(points))
        x = 2 * (points[:, 0] / planar - window.left) / (window.right - window.left) - 1
        y = 2 * (points[:, 1] / planar - window.bottom) / (window.top - window.bottom) - 1
        seen = (np.abs(x) <= 1) & (np.abs(y) <= 1)
        left, bottom = corners[index, 0, :2]
        right, top = corners[index, 3, :2]
        assert np.all((x[seen] >= left) & (x[seen] <= right) & (y[seen] >= bottom) & (y[seen] <= top))
        distance = np.linalg.norm(points, axis=1) if camera.is_perspective else -points[:, 2]
        assert np.all(distance[seen] * DEPTH_SCALE * 2 - 1 >= corners[index, :, 2].max())
    assert behind > 0 or projection == "orthographic"


def test_a_group_far_away_is_not_drawn_over_the_whole_image():
    camera = CAMERAS["perspective"]
    positions = np.random.default_rng(4).normal([0, 8, 0], 0.05, (300, 3))
    balls = in_spatial_order(view_balls(meniscus.Balls(positions, 0.05), camera, meniscus.Field()))
    corners = ball_groups(balls).corners(camera, DEPTH_SCALE)
    assert np.all(corners[:, 3, :2] - corners[:, 0, :2] < 0.2)
    assert np.all((corners[:, 0, 2] + 1) / 2 / DEPTH_SCALE > 8)
