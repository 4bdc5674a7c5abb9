"""What only Vicinity can get wrong: its lists, its samples, and the parts in which balls share a ray."""

from __future__ import annotations

from dataclasses import replace

import judge as judging
import numpy as np
import pytest
from judge import EXACT, judge
from scenes import SCENES, Scene
from test_random_views import random_scene

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.method import Request
from meniscus.addon.render.registry import create_method
from meniscus.addon.render.settings import checked_settings
from meniscus.gpu_shaders.methods.vicinity import method as vicinity

# Rims, coincident balls, crossings of many spheres, starts inside, the far clip plane, digits, sizes, carving, creases.
EXACT_SCENES = [
    "ten_balls",
    "coincident_balls",
    "tangent_rays",
    "eye_behind_kernel_sphere",
    "near_clip_cuts_fluid",
    "far_from_origin",
    "radii_over_six_orders",
    "crowded_corner",
    "negative_weights",
    "kernel_power_1",
]


def rendered(scene, camera, passes=("depth", "normal"), **settings):
    return meniscus.render(scene.balls, camera, scene.field, method="vicinity", passes=passes, settings=settings)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("name", EXACT_SCENES)
def test_the_exact_surface_is_as_exact_as_that_of_other_methods(monkeypatch, name, projection):
    monkeypatch.setitem(judging.BOUNDS, "vicinity", EXACT)
    scene = SCENES[name]()
    camera = scene.camera(projection)
    judge(rendered(scene, camera, exact=True), scene, camera)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_exact_surface_of_random_views(monkeypatch, projection):
    monkeypatch.setitem(judging.BOUNDS, "vicinity", EXACT)
    for seed in range(12):
        scene = random_scene(seed)
        camera = replace(scene.camera(projection), width=24, height=18)
        judge(rendered(scene, camera, exact=True), scene, camera)


def test_the_error_falls_with_the_square_of_the_step():
    """The surface lies on the secant of the last step: half the step, a quarter of the error, except where rays graze."""
    scene = SCENES["ten_balls"]()
    camera = scene.camera("orthographic")
    exact = rendered(scene, camera, exact=True)

    def typical_error(**settings):
        image = rendered(scene, camera, **settings)
        assert np.count_nonzero(image.hit != exact.hit) <= 2
        both = image.hit & exact.hit
        # Where one ball alone makes the surface it is exact.
        return np.percentile(np.abs(image["depth"][both] - exact["depth"][both]), 80)

    errors = np.array([typical_error(samples=samples, bisections=0) for samples in (32, 64, 128)])
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 1.7), errors
    # Two bisections are as good as four times the samples.
    assert 0.5 < typical_error(samples=32, bisections=2) / errors[2] < 2
    assert typical_error(samples=32, bisections=20) < 1e-5


def test_nothing_is_missed_at_the_rims_of_balls():
    """Far more than a pixel's width of each rim is thinner than a step."""
    scene = SCENES["ten_balls"]()
    camera = replace(scene.camera("orthographic"), width=288, height=216)
    few, many = rendered(scene, camera, samples=4), rendered(scene, camera, exact=True)
    assert np.count_nonzero(few.hit != many.hit) <= 2


def test_nothing_is_lost_where_the_surface_leaves_a_kernel_sphere():
    """A hole opened where the surface was nearer to a kernel sphere than distances are rounded: the depth test dropped it."""
    random = np.random.default_rng(3)
    scene = Scene(
        meniscus.Balls(20 * random.random((120, 3)) / 6 + [7, 5, 3], 1.0), (8.6, -6.0, 4.6), (8.6, 6.6, 4.6), view_height=4.0
    )
    camera = replace(scene.camera("perspective"), width=240, height=240)
    reference = meniscus.render(scene.balls, camera, scene.field, method="tile_caster")
    for samples in (50, 100, 400, 999):
        image = rendered(scene, camera, samples=samples)
        assert np.count_nonzero(image.hit != reference.hit) <= 1
        both = image.hit & reference.hit
        assert np.count_nonzero(np.abs(image["depth"] - reference["depth"])[both] > 1e-3) <= 2


def test_small_balls_in_a_large_one_are_not_missed():
    """A plate far thinner than the steps in the large ball: its balls have parts of their own, with steps of their own."""
    across = np.stack(np.meshgrid(np.linspace(-1, 1, 21), [0.0], np.linspace(-1, 1, 21)), axis=-1).reshape(-1, 3)
    plate = meniscus.Balls(
        np.concatenate([across, [[0, 0, 0]]]), np.append(np.full(len(across), 0.15), 3.0), np.append(np.ones(len(across)), 0.05)
    )
    scene = Scene(plate, view_height=1.0)
    camera = scene.camera("orthographic")
    assert rendered(scene, camera).hit.mean() == 1.0
    assert rendered(scene, camera, exact=True).hit.mean() == 1.0


def test_lists_stay_while_the_balls_do():
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    first = rendered(scene, camera)
    assert first.info.milliseconds["neighbours"] > 0
    again = meniscus.render(scene.balls, camera, meniscus.Field("quartic", 0.3), method="vicinity")
    assert "neighbours" not in again.info.milliseconds
    assert again.info.counts["neighbours"] == first.info.counts["neighbours"] > 0
    fresh = SCENES["ten_balls"]()
    other = meniscus.render(fresh.balls, camera, meniscus.Field("quartic", 0.3), method="vicinity")
    assert "neighbours" in other.info.milliseconds
    # The kernel spheres are those of the new field.
    np.testing.assert_array_equal(other["depth"], again["depth"])
    assert np.count_nonzero(again.hit != first.hit) > 50


def test_balls_without_neighbours_are_their_kernel_spheres():
    scene = Scene(meniscus.Balls([[-0.7, 0, 0], [0.7, 0, 0], [0.7, 0.3, 0], [0, 0, 1.2]], [0.6, 0.6, 0.6, 0.5]))
    camera = scene.camera("perspective")
    image = rendered(scene, camera)
    assert image.info.counts == image.info.counts | {"lone_balls": 2, "neighbours": 2}
    judge(image, scene, camera)


def test_an_eye_in_a_lone_ball_sees_it_from_within():
    scene = Scene(meniscus.Balls([[0, 0, 0]], 2.0), eye=(0.0, -0.3, 0.0))
    camera = scene.camera("perspective")
    image = rendered(scene, camera)
    assert image.hit.all()
    judge(image, scene, camera)


def test_thousands_of_balls_in_one_place_are_drawn():
    scene = Scene(meniscus.Balls(np.zeros((2000, 3)), 1.0, weights=1e-3))
    camera = replace(scene.camera("perspective"), width=24, height=18)
    image = rendered(scene, camera)
    assert image.info.counts["neighbours"] == 2000 * 1999
    judge(image, scene, camera)


def test_more_neighbours_than_a_buffer_texture_holds_are_an_error(pretend_limits):
    pretend_limits(texture_buffer_size=65536)
    balls = meniscus.Balls(np.zeros((1000, 3)), 1.0)
    camera = Scene(balls).camera("perspective")
    with pytest.raises(InputError, match=r"1000 balls overlap in more than 65536 places.*use fewer balls"):
        meniscus.render(balls, camera, meniscus.Field(), method="vicinity")


def test_a_kernel_that_is_no_polynomial_is_sampled_and_has_no_exact_search():
    scene = replace(SCENES["ten_balls"](), field=meniscus.Field("mishima", 0.6))
    camera = scene.camera("perspective")
    assert rendered(scene, camera).hit.mean() > 0.2
    with pytest.raises(InputError, match="polynomial kernels only"):
        rendered(scene, camera, exact=True)


@pytest.mark.parametrize("exact", [False, True])
def test_attributes_and_parts_of_an_image(monkeypatch, exact):
    random = np.random.default_rng(8)
    balls = SCENES["ten_balls"]().balls
    balls = meniscus.Balls(balls.positions, balls.radii, None, random.random((10, 3)), random.random((10, 3)))
    camera = SCENES["ten_balls"]().camera("perspective")
    request = {
        "field": meniscus.Field(),
        "passes": ("depth", "normal", "combined", "vector"),
        "look": meniscus.Look(style="flat"),
    }
    whole = meniscus.render(balls, camera, method="vicinity", settings={"exact": exact}, **request)
    monkeypatch.setattr(vicinity.Vicinity, "pixels_a_part", 14 * camera.width)
    parts = meniscus.render(balls, camera, method="vicinity", settings={"exact": exact}, **request)
    reference = meniscus.render(balls, camera, method="tile_caster", **request)
    np.testing.assert_array_equal(parts.hit, whole.hit)
    np.testing.assert_allclose(parts["depth"], whole["depth"], rtol=1e-5)
    np.testing.assert_allclose(whole["combined"], reference["combined"], atol=5e-3)
    np.testing.assert_allclose(whole["vector"], reference["vector"], atol=0.05)


def test_the_surface_on_the_device_is_the_same():
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    info, method = create_method("vicinity")
    settings = checked_settings(info.name, info.settings, None)
    request = Request(scene.balls, camera, scene.field, frozenset(), 0, lambda _: None, settings=settings)
    textures = method.find_surface_on_device(request)
    np.testing.assert_array_equal(textures.read_back()["depth"], method.find_surface(request).depth)
    textures.release()
