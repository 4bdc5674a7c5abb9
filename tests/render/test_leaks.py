"""Camera rays at closed scenes: not one of a hundred million may pass through the surface."""

from __future__ import annotations

import numpy as np
import pytest
from leaks import HEIGHT, PROJECTIONS, SCENES, WIDTH, leaks

import meniscus

RAYS = 100_000_000
_CASES = len(SCENES) * len(PROJECTIONS)
# Images of each scene in each projection.
IMAGES = -(-RAYS // (_CASES * WIDTH * HEIGHT))


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_are_closed(name, projection):
    scene, random = SCENES[name](), np.random.default_rng(1)
    for _ in range(2):
        camera = scene.camera(random, projection)
        rows, columns = random.integers(HEIGHT, size=150), random.integers(WIDTH, size=150)
        origins, directions = (rays[rows, columns] for rays in camera.view_rays())
        rotation = camera.world_from_view[:3, :3].T
        starts = (origins + camera.clip_start * directions) @ rotation + camera.eye
        unit = (directions / np.linalg.norm(directions, axis=1, keepdims=True)) @ rotation
        t, _ = meniscus.oracle.cast(scene.balls, scene.field, starts, unit)
        assert np.all(np.isfinite(t))
        gauge = scene.gauge(tuple((starts + t[:, None] * unit - camera.eye).T), camera.eye)
        assert scene.nearest <= gauge.min() <= gauge.max() <= scene.farthest


@pytest.mark.slow
@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("name", SCENES)
def test_no_ray_leaks(name, projection):
    scene, random = SCENES[name](), np.random.default_rng(list(SCENES).index(name))
    found = [leaks(scene, scene.camera(random, projection)) for _ in range(IMAGES)]
    assert sum(image.rays for image in found) * _CASES >= RAYS
    assert [(image.missed, image.misplaced) for image in found] == [(0, 0)] * IMAGES
