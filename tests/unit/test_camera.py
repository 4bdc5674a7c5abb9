"""Cameras: rays, projections, regions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.camera import Region, Window
from meniscus.addon.fluid.errors import InputError

PERSPECTIVE = meniscus.Camera.perspective((1, -5, 2), (0, 1, 0.5), fov_y=0.8, width=40, height=30)
ORTHOGRAPHIC = meniscus.Camera.orthographic((1, -5, 2), (0, 1, 0.5), scale=3, width=40, height=30)
SHIFTED = replace(PERSPECTIVE, window=Window(-0.2, 0.7, -0.5, 0.1))


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC, SHIFTED])
def test_rays_and_projection_agree(camera):
    origins, directions = camera.view_rays()
    points = np.ones((30, 40, 4))
    points[..., :3] = origins + 7.5 * directions
    clip = points @ camera.clip_from_view.T
    pixels = (clip[..., :2] / clip[..., 3:] + 1) / 2 * (40, 30)
    rows, columns = np.mgrid[0:30, 0:40]
    np.testing.assert_allclose(pixels, np.stack([columns, rows], -1) + 0.5, atol=1e-9)
    np.testing.assert_allclose(-points[..., 2], 7.5)


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC])
def test_clip_planes_bound_the_clip_space(camera):
    for distance, expected in ((camera.clip_start, -1), (camera.clip_end, 1)):
        clip = camera.clip_from_view @ (0, 0, -distance, 1)
        assert clip[2] / clip[3] == pytest.approx(expected)


def test_camera_looks_at_its_target_with_its_up_upwards():
    in_view = PERSPECTIVE.view_from_world @ (0, 1, 0.5, 1)
    np.testing.assert_allclose(in_view[:2], 0, atol=1e-12)
    assert in_view[2] < 0
    assert (PERSPECTIVE.view_from_world @ (0, 0, 1, 0))[1] > 0


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC, SHIFTED])
def test_cropped_camera_has_the_rays_of_its_region(camera):
    region = replace(camera, region=Region(5, 10, 25, 29))
    for part, whole in zip(region.cropped().view_rays(), camera.view_rays(), strict=True):
        np.testing.assert_allclose(part, whole[10:29, 5:25], atol=1e-12)
    for part, cropped in zip(region.view_rays(), region.cropped().view_rays(), strict=True):
        np.testing.assert_allclose(part, cropped, atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"width": 0},
        {"clip_start": -1.0},
        {"clip_start": 5.0, "clip_end": 5.0},
        {"clip_end": float("inf")},
        {"window": Window(1, 1, 0, 1)},
        {"region": Region(0, 0, 41, 30)},
        {"region": Region(4, 4, 4, 8)},
        {"world_from_view": np.full((4, 4), np.nan)},
    ],
)
def test_unusable_cameras_are_rejected(change):
    with pytest.raises(InputError):
        replace(PERSPECTIVE, **change)


def test_camera_needs_a_direction():
    with pytest.raises(InputError, match="differs from its target"):
        meniscus.Camera.perspective((1, 1, 1), (1, 1, 1))
    with pytest.raises(InputError, match="up direction"):
        meniscus.Camera.perspective((0, 0, 5), (0, 0, 0))
