"""The camera of a viewport: its rays are those of the matrices that Blender draws with."""

import numpy as np
import pytest

from meniscus import Camera
from meniscus.addon.blender.view_camera import rigid, view_camera
from meniscus.addon.fluid.errors import InputError

BOUNDS = np.array([[-1.0, -1, -1], [1, 1, 1]])
PERSPECTIVE = Camera.perspective((3, -4, 2), (0, 0, 0), fov_y=0.8, width=90, height=60, clip_start=0.1, clip_end=100)
SIDEWAYS = Camera(PERSPECTIVE.world_from_view, PERSPECTIVE.shifted(31, -12).window, True, 90, 60, 0.1, 100)


def orthographic(clip):
    """Blender's matrices of an orthographic viewport: it reaches as far behind the eye as before it."""
    camera = Camera.orthographic((3, -4, 2), (0, 0, 0), scale=3, width=90, height=60)
    projection = camera.clip_from_view
    projection[2, 2], projection[2, 3] = -1 / clip, 0
    return camera, projection


def seen_through(camera, projection=None, bounds=BOUNDS):
    """Through Blender's matrices, which are made of floats."""
    projection = camera.clip_from_view if projection is None else projection
    return view_camera(camera.view_from_world.astype(np.float32), projection.astype(np.float32), 90, 60, bounds)


def window_depth(planar, seen):
    """Of a point on the view axis at a planar depth of `seen.camera`, by Blender's projection."""
    z = -(planar + seen.depth_offset)
    clip = seen.projection @ np.array([0, 0, z, 1])
    return clip[2] / clip[3]


@pytest.mark.parametrize("camera", [PERSPECTIVE, SIDEWAYS])
def test_a_perspective_view_is_taken_as_it_is(camera):
    seen = seen_through(camera)
    assert seen.depth_offset == 0
    assert seen.camera.region is not None
    np.testing.assert_allclose(seen.camera.clip_from_view, camera.clip_from_view, atol=2e-5)
    np.testing.assert_allclose(seen.camera.world_from_view, camera.world_from_view, atol=1e-5)
    assert seen.camera.clip_start == pytest.approx(0.1, rel=1e-4)
    assert seen.camera.clip_end == pytest.approx(100, rel=1e-2), "its digits are lost in the matrix"


def test_an_orthographic_view_starts_where_the_fluid_does():
    camera, projection = orthographic(1000)
    seen = seen_through(camera, projection)
    corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), -1).reshape(-1, 3)
    depths = (corners - seen.camera.eye) @ -seen.camera.world_from_view[:3, 2]
    assert depths.min() == pytest.approx(0, abs=1e-4)
    np.testing.assert_allclose(seen.camera.clip_from_view[:2], camera.clip_from_view[:2], atol=1e-5)
    there = seen.camera.world_from_view[:3, 2] * -2.5 + seen.camera.eye
    expected = projection @ camera.view_from_world @ [*there, 1]
    assert window_depth(2.5, seen) == pytest.approx(expected[2], abs=1e-6)


def test_fluid_behind_an_orthographic_eye_is_seen():
    camera, projection = orthographic(1000)
    seen = seen_through(camera, projection, BOUNDS + 50 * camera.world_from_view[:3, 2])
    assert seen.depth_offset < -40
    corners = BOUNDS + 50 * camera.world_from_view[:3, 2] - seen.camera.eye
    assert corners @ -seen.camera.world_from_view[:3, 2] == pytest.approx([2, 2], abs=2)


@pytest.mark.parametrize("distance", [-5000, 5000])
def test_fluid_beyond_the_clip_distances_is_not_in_the_view(distance):
    camera, projection = orthographic(1000)
    assert seen_through(camera, projection, BOUNDS + distance * camera.world_from_view[:3, 2]) is None


@pytest.mark.parametrize("camera", [PERSPECTIVE, SIDEWAYS])
def test_only_the_part_of_the_viewport_with_fluid_is_looked_at(camera):
    small = BOUNDS * 0.2
    seen = seen_through(camera, bounds=small)
    region, cropped = seen.camera.region, seen.camera.cropped()
    assert 0 < region.width < 60
    assert 0 < region.height < 50
    corners = np.stack(np.meshgrid(*small.T), -1).reshape(-1, 3)
    clip = np.column_stack([corners, np.ones(8)]) @ (cropped.clip_from_view @ cropped.view_from_world).T
    places = clip[:, :2] / clip[:, 3:]
    edge = 2 * 3 / np.array([region.width, region.height])
    assert np.all((places.min(axis=0) >= -1 - 1e-9) | (np.array([region.x_min, region.y_min]) == 0))
    assert np.all((places.min(axis=0) <= -1 + edge) | (np.array([region.x_min, region.y_min]) == 0))
    left, bottom, right, top = seen.rectangle_of(cropped.window)
    np.testing.assert_allclose([left, right], [2 * region.x_min / 90 - 1, 2 * region.x_max / 90 - 1], atol=1e-9)
    np.testing.assert_allclose([bottom, top], [2 * region.y_min / 60 - 1, 2 * region.y_max / 60 - 1], atol=1e-9)


def test_fluid_around_the_eye_fills_the_viewport():
    seen = seen_through(PERSPECTIVE, bounds=BOUNDS * 6)
    assert (seen.camera.region.width, seen.camera.region.height) == (90, 60)


def test_fluid_beside_the_view_is_not_in_it():
    assert seen_through(PERSPECTIVE, bounds=BOUNDS + 9 * PERSPECTIVE.world_from_view[:3, 0]) is None


def test_depths_of_an_earlier_camera_are_carried_over():
    camera, projection = orthographic(1000)
    earlier, now = seen_through(camera, projection), seen_through(camera, projection, BOUNDS * 3)
    assert now.offset_of(now.camera) == now.depth_offset
    assert now.offset_of(earlier.camera) == pytest.approx(earlier.depth_offset)


def test_a_sheared_view_is_refused_in_one_sentence():
    sheared = np.eye(4)
    sheared[0, 1] = 0.3
    with pytest.raises(InputError, match="sheared"):
        rigid(sheared)
