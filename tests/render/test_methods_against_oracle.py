"""Every registered method, on every scene, in both projections, against the oracle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import bounds_of, expected, judge
from scenes import SCENES

import meniscus
from meniscus.addon.render.depth_contrast import spatial_importance
from meniscus.addon.render.registry import method_infos

HEADLIGHT = meniscus.Look(style="headlight")
METHODS = [info.name for info in method_infos("metaballs")]


LARGE_SCENES = ("eye_inside_fluid", "long_lists", "random_5000", "lattice_with_droplets")
SCENE_NAMES = [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE_SCENES else []) for name in SCENES]


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("scene_name", SCENE_NAMES)
@pytest.mark.parametrize("method", METHODS)
def test_surface_matches_oracle(method, scene_name, projection):
    scene = SCENES[scene_name]()
    camera = scene.camera(projection)
    image = meniscus.render(scene.balls, camera, scene.field, method=method)
    assert 0.02 < image.hit.mean() <= 1.0, "the scene should show something"
    judge(image, scene, camera)


def test_overflow_is_counted_only_where_it_happens():
    scene = SCENES["long_lists"]()
    camera = scene.camera("perspective")
    assert meniscus.render(scene.balls, camera, scene.field, method="depth_peeling").info.counts["overflows"] > 100
    scene = SCENES["ten_balls"]()
    assert meniscus.render(scene.balls, camera, scene.field, method="depth_peeling").info.counts["overflows"] == 0


def test_depth_peeling_in_bands_gives_the_same_image(monkeypatch):
    from meniscus.gpu_shaders.methods.depth_peeling import method

    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = meniscus.render(scene.balls, camera, scene.field, method="depth_peeling")
    # Fourteen rows a band; the last has only two.
    monkeypatch.setattr(method, "_PIXELS_A_PART", 14 * camera.width)
    in_bands = meniscus.render(scene.balls, camera, scene.field, method="depth_peeling")
    judge(in_bands, scene, camera)
    np.testing.assert_array_equal(in_bands.hit, whole.hit)
    np.testing.assert_allclose(in_bands["depth"], whole["depth"], rtol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_colors_blend_by_their_share_of_the_density(method):
    # Half way between two equal balls both colours count alike; on the far side of one only its own.
    balls = meniscus.Balls([[-0.3, 0, 0], [0.3, 0, 0]], 0.8, colors=[[1, 0, 0], [0, 0, 1]])
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2, width=41, height=41)
    look = meniscus.Look(style="flat")
    image = meniscus.render(balls, camera, meniscus.Field(), method=method, passes=("combined",), look=look)
    row = image["combined"][20]
    np.testing.assert_allclose(row[20], [0.5, 0, 0.5, 1], atol=1e-5)
    np.testing.assert_allclose(row[7], [1, 0, 0, 1], atol=1e-5)
    np.testing.assert_allclose(row[33], [0, 0, 1, 1], atol=1e-5)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("method", METHODS)
def test_depth_contrast_is_that_of_the_exact_depths(method, projection):
    scene = SCENES["ten_balls"]()
    camera = scene.camera(projection)
    want = expected(scene.balls, scene.field, camera)
    hit = np.isfinite(want.t).reshape(camera.height, camera.width)
    depth = np.where(hit, (want.t / want.stretch).reshape(hit.shape), 1e10).astype(np.float32)
    plain, changed = (
        meniscus.render(scene.balls, camera, scene.field, method=method, passes=("combined",), look=look)["combined"]
        for look in (HEADLIGHT, replace(HEADLIGHT, depth_contrast=4.0, depth_contrast_radius=0.05))
    )
    factor = 1 + np.tanh(4 * spatial_importance(depth, hit, camera, 0.05))
    assert np.ptp(factor[hit]) > 1, "the scene should have steps in depth"
    both = hit & (plain[..., 3] > 0)
    assert np.count_nonzero(hit != (plain[..., 3] > 0)) <= 2
    off = ~np.isclose(changed[both][:, 2], plain[both][:, 2] * factor[both], rtol=1e-7, atol=2e-3)
    assert np.count_nonzero(off) <= bounds_of(method).wrong * off.size
    np.testing.assert_array_equal(changed[..., 3], plain[..., 3])


@pytest.mark.parametrize("method", METHODS)
def test_no_balls_give_an_empty_image(method):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=8, height=6)
    image = meniscus.render(meniscus.Balls(np.zeros((0, 3)), 1.0), camera, meniscus.Field(), method=method)
    assert not image.hit.any()
    assert np.all(image["depth"] == np.float32(1e10))
    assert np.all(image["normal"] == 0)


@pytest.mark.parametrize("method", METHODS)
def test_balls_without_a_surface_give_an_empty_image(method):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=32, height=24)
    balls = meniscus.Balls([[0, 0, 0], [0.1, 0, 0]], 1.0, weights=[0.05, -1])
    assert not meniscus.render(balls, camera, meniscus.Field(), method=method).hit.any()


@pytest.mark.slow
def test_ten_million_balls():
    positions = np.random.default_rng(9).random((10_000_000, 3), dtype=np.float32) - 0.5
    camera = meniscus.Camera.perspective((0, -3, 0), (0, 0, 0), fov_y=0.5, width=32, height=24)
    image = meniscus.render(meniscus.Balls(positions, 0.004), camera, meniscus.Field(), method="tile_caster")
    assert image.info.counts["balls"] == 10_000_000
    # All but the outer layers is hidden.
    assert 10_000 < image.info.counts["balls_drawn"] < 1_000_000
    # The balls fill a unit cube so densely that its front face is closed.
    assert np.all(np.abs(image["depth"][10:14, 14:18] - 2.5) < 0.05)
