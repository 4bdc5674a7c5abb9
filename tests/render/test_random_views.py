"""Random balls of all kernels and weights, seen from anywhere: inside the fluid, behind a ball, between balls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import bounds_of, compare, judge
from scenes import Scene

import meniscus
from meniscus.addon.fluid.kernels import POLYNOMIAL_KERNELS
from meniscus.addon.render.registry import method_infos


def random_scene(seed):
    """Up to 24 balls around the origin, an eye among them; every third scene has balls that carve."""
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 25))
    weights = random.uniform(0.3, 1.5, count)
    if seed % 3 == 0:
        weights *= random.choice([1, 1, 1, -1], count)
    return Scene(
        meniscus.Balls(random.uniform(-1.5, 1.5, (count, 3)), random.uniform(0.2, 1.2, count), weights),
        eye=tuple(random.uniform(-1.5, 1.5, 3)),
        target=tuple(random.uniform(-1.5, 1.5, 3)),
        view_height=float(random.uniform(0.3, 2)),
        field=meniscus.Field(str(random.choice(list(POLYNOMIAL_KERNELS))), float(random.uniform(0.1, 0.6))),
    )


@pytest.mark.slow
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("method", [info.name for info in method_infos("metaballs")])
def test_random_views_match_the_oracle(method, projection):
    hits, wrong, bounds = 0, [], bounds_of(method)
    for seed in range(40):
        scene = random_scene(seed)
        camera = replace(scene.camera(projection), width=32, height=24)
        image = meniscus.render(scene.balls, camera, scene.field, method=method)
        if bounds.wrong:
            # An image of so few pixels can be wrong at one and not at a thousandth.
            wrong += compare(image, scene, camera).wrong
        else:
            judge(image, scene, camera)
        hits += int(image.hit.sum())
    assert len(wrong) <= bounds.wrong * 40 * 32 * 24, wrong
    assert hits > 0.1 * 40 * 32 * 24
