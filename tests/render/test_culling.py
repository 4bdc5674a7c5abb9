"""Kernel spheres hide only what cannot be seen: thousands of balls, each image judged at random pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import bounds_of, expected, is_undecidable
from scenes import Scene

import meniscus
from meniscus.addon.render.registry import method_infos

METHODS = [info.name for info in method_infos("metaballs")]
SIZE, PIXELS = (480, 360), 1500
SMALL_SIZE = 160, 120
"""For methods that sample, which take many passes."""
SAMPLING = [method for method in METHODS if bounds_of(method).wrong]
EXACT = [method for method in METHODS if method not in SAMPLING]
CASES = [(method, 0, "perspective") for method in SAMPLING]
CASES += [(method, seed, projection) for method in EXACT for seed in range(3) for projection in ("perspective", "orthographic")]


def crowd(seed: int, count: int, weights: np.ndarray, radii: np.ndarray) -> Scene:
    """Balls all over the view, many behind one another."""
    random = np.random.default_rng(seed)
    positions = random.uniform(-1, 1, (count, 3)) * [1.2, 1.5, 1]
    return Scene(meniscus.Balls(positions, radii, weights), eye=(0.3, -5.0, 0.2), view_height=2.2)


def carved(seed: int) -> Scene:
    """A third of the balls carve."""
    random = np.random.default_rng(100 + seed)
    weights = random.uniform(0.3, 1.5, 2000) * np.where(random.random(2000) < 1 / 3, -1, 1)
    return crowd(seed, 2000, weights, random.uniform(0.08, 0.25, 2000))


def carved_by_one(seed: int) -> Scene:
    """A few large balls carve into many that else hide one another."""
    random = np.random.default_rng(200 + seed)
    weights, radii = random.uniform(0.5, 1.5, 2000), random.uniform(0.1, 0.25, 2000)
    weights[:6], radii[:6] = -20, 0.5
    return crowd(seed, 2000, weights, radii)


def mixed(seed: int) -> Scene:
    """Radii and weights from a thousandth to a thousand; the larger the ball, the farther away it is."""
    random = np.random.default_rng(300 + seed)
    radii = 10 ** random.uniform(-3, 3, 2000)
    directions = random.uniform(-1, 1, (2000, 3)) * [0.5, 0, 0.4] + [0, 1, 0]
    positions = directions * (radii * random.uniform(4, 40, 2000))[:, None]
    balls = meniscus.Balls(positions, radii, 10 ** random.uniform(-3, 3, 2000))
    return Scene(balls, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), view_height=0.8, clip_start=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("make", [carved, carved_by_one, mixed])
@pytest.mark.parametrize(("method", "seed", "projection"), CASES)
def test_what_is_hidden_could_not_be_seen(method, make, seed, projection):
    scene, bounds = make(seed), bounds_of(method)
    width, height = SMALL_SIZE if bounds.wrong else SIZE
    camera = replace(scene.camera(projection), width=width, height=height)
    image = meniscus.render(scene.balls, camera, scene.field, method=method)
    assert image.hit.mean() > 0.2
    pixels = np.random.default_rng(seed).choice(width * height, PIXELS, replace=False)
    want = expected(scene.balls, scene.field, camera, pixels)
    t = np.where(image.hit, image["depth"], np.inf).ravel()[pixels] * want.stretch
    apart = np.abs(np.subtract(t, want.t, out=np.zeros(PIXELS), where=np.isfinite(t) & np.isfinite(want.t)))
    wrong = np.flatnonzero((np.isfinite(t) != np.isfinite(want.t)) | (apart > bounds.distance * want.radius))
    undecidable = [index for index in wrong if is_undecidable(scene.balls, scene.field, want, index, camera, t[index])]
    assert len(undecidable) <= 0.002 * PIXELS
    assert len(wrong) - len(undecidable) <= bounds.wrong * PIXELS
