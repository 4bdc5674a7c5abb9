"""Spheres and ellipsoids: every method that shows them, against the closed form in double precision."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.displays import DISPLAYS
from meniscus.addon.render.glyphs import glyphs_of
from meniscus.addon.render.method import Request
from meniscus.addon.render.registry import create_method, method_infos

GLYPHS = ("spheres", "ellipsoids")
METHODS = [info.name for info in method_infos("spheres")]
PROJECTIONS = ("perspective", "orthographic")


def test_every_display_has_a_method_on_each_back_end():
    for display in DISPLAYS:
        assert {info.backend for info in method_infos(display)} == {"gpu", "cpu"}


@dataclass
class Expected:
    """What the closed form says of each pixel: planar depth (inf: nothing), unit normal, ball, and the share of the glyph's
    width by which the ray passes its border."""

    depth: np.ndarray
    normal: np.ndarray
    ball: np.ndarray
    margin: np.ndarray


def expected(scene: Scene, camera: meniscus.Camera, display: str) -> Expected:
    """Intersect every ray with every glyph."""
    request = Request(scene.balls, camera, scene.field, frozenset(), 0, lambda _: None, display=display)
    glyphs = glyphs_of(request)
    rotation = camera.world_from_view[:3, :3]
    origins, directions = (array.reshape(-1, 3) @ rotation.T for array in camera.view_rays())
    origins = origins + camera.eye
    # Directions with a planar depth of 1.
    directions = directions / -(directions @ rotation)[:, 2:]
    best = Expected(
        np.full(len(origins), np.inf), np.zeros_like(origins), np.full(len(origins), -1), np.full(len(origins), np.inf)
    )
    for index in range(len(glyphs)):
        extent = glyphs.extents[index].astype(np.float64)
        axes = extent * np.eye(3) if glyphs.are_spheres else extent.reshape(3, 3)
        into_unit = axes / np.sum(axes**2, axis=1, keepdims=True)
        start = (origins - glyphs.centers[index].astype(np.float64)) @ into_unit.T
        way = directions @ into_unit.T
        a, b = np.sum(way**2, axis=1), np.sum(way * start, axis=1)
        nearest = start - (b / a)[:, None] * way
        rest = 1 - np.sum(nearest**2, axis=1)
        half = np.sqrt(np.maximum(rest, 0) / a)
        front, back = -b / a - half, -b / a + half
        depth = np.where(front >= camera.clip_start, front, back)
        is_met = (rest >= 0) & (depth >= camera.clip_start) & (depth <= camera.clip_end)
        ends = np.min(np.abs(np.stack([front, back])[:, :, None] - [camera.clip_start, camera.clip_end]), axis=(0, 2))
        best.margin = np.minimum(best.margin, np.where(rest > -0.1, np.minimum(np.abs(rest), ends), np.inf))
        is_nearer = is_met & (depth < best.depth)
        gradient = (start + depth[:, None] * way) @ into_unit
        best.normal[is_nearer] = (gradient / np.linalg.norm(gradient, axis=1, keepdims=True))[is_nearer]
        best.ball[is_nearer] = glyphs.balls[index]
        best.depth[is_nearer] = depth[is_nearer]
    return best


def judge(image, want: Expected, shape, tolerance):
    """Hits and balls but where a border or another surface is too near to decide; depths and normals."""
    hit, should_hit = image.hit.ravel(), np.isfinite(want.depth)
    is_decided = want.margin > 1e-3
    assert np.mean(is_decided) > 0.9
    np.testing.assert_array_equal(hit[is_decided], should_hit[is_decided])
    depth = image["depth"].ravel()
    both = hit & should_hit & is_decided
    np.testing.assert_allclose(depth[both], want.depth[both], rtol=tolerance, atol=tolerance)
    same = both & (image["ball_id"].ravel() == want.ball)
    assert np.count_nonzero(both & ~same) <= 0.002 * both.size
    angles = 1 - np.sum(image["normal"].reshape(-1, 3)[same] * want.normal[same], axis=1)
    assert np.max(angles, initial=0) < 1e-4
    return both


def picture(scene, camera, display, method, **options):
    return meniscus.render(
        scene.balls, camera, scene.field, method=method, display=display, passes=("depth", "normal", "ball_id"), **options
    )


SMALL_SCENES = (
    *("one_ball", "two_balls", "ten_balls", "ball_behind_ball", "eye_inside_influence_sphere", "eye_inside_fluid"),
    *("near_clip_cuts_fluid", "far_from_origin", "radii_over_six_orders", "negative_weights"),
)


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("scene_name", SMALL_SCENES)
@pytest.mark.parametrize("display", GLYPHS)
@pytest.mark.parametrize("method", METHODS)
def test_glyphs_match_the_closed_form(method, display, scene_name, projection):
    scene = SCENES[scene_name]()
    camera = scene.camera(projection)
    image = picture(scene, camera, display, method)
    both = judge(image, expected(scene, camera, display), (camera.height, camera.width), 2e-5)
    assert np.count_nonzero(both) > 50


def random_scene(seed: int) -> Scene:
    """Droplets of one to some balls around the origin, an eye among them."""
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 40))
    return Scene(
        meniscus.Balls(random.uniform(-2, 2, (count, 3)), random.uniform(0.2, 1.0, count), random.uniform(0.3, 1.5, count)),
        eye=tuple(random.uniform(-2, 2, 3)),
        target=tuple(random.uniform(-2, 2, 3)),
        view_height=float(random.uniform(0.3, 3)),
        field=meniscus.Field("quartic", float(random.uniform(0.1, 0.5))),
        clip_start=float(random.uniform(0.01, 1)),
        clip_end=float(random.uniform(2, 6)),
    )


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("display", GLYPHS)
@pytest.mark.parametrize("method", METHODS)
def test_random_views_match_the_closed_form(method, display, projection):
    hits = 0
    for seed in range(20):
        scene = random_scene(seed)
        camera = replace(scene.camera(projection), width=32, height=24)
        both = judge(picture(scene, camera, display, method), expected(scene, camera, display), (24, 32), 1e-5)
        hits += np.count_nonzero(both)
    assert hits > 0.1 * 20 * 32 * 24


@pytest.mark.parametrize("display", GLYPHS)
def test_both_back_ends_give_the_same_picture(display):
    """A crowd in colours, with all attributes, within 2/255."""
    random = np.random.default_rng(8)
    columns = {"colors": random.random((3000, 3)), "velocities": random.normal(size=(3000, 3))}
    balls = meniscus.Balls(random.uniform(-1, 1, (3000, 3)), random.uniform(0.05, 0.12, 3000), **columns)
    camera = meniscus.Camera.perspective((0, -4, 1), (0, 0, 0), fov_y=0.6, width=320, height=240)
    field, look = meniscus.Field(isovalue=0.3), meniscus.Look("studio")
    passes = ("combined", "depth", "normal", "color", "velocity", "ball_id", "cluster_id")
    gpu, cpu = (
        meniscus.render(balls, camera, field, method=method, display=display, passes=passes, look=look) for method in METHODS
    )
    assert {gpu.info.backend, cpu.info.backend} == {"gpu", "cpu"}
    same = gpu["ball_id"] == cpu["ball_id"]
    assert np.mean(~same) < 5e-4
    assert np.mean(gpu.hit) > 0.2
    np.testing.assert_allclose(gpu["depth"][same], cpu["depth"][same], rtol=1e-5)
    for name in ("combined", "normal", "color", "velocity", "cluster_id"):
        difference = np.abs(gpu[name] - cpu[name])[same]
        assert np.mean(difference > 2 / 255) < 5e-4, name
        assert np.mean(difference) < 1e-4, name


@pytest.mark.parametrize("display", GLYPHS)
def test_parts_of_an_image_give_the_same(monkeypatch, display):
    from meniscus.gpu_shaders.methods.glyphs import method

    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = picture(scene, camera, display, "glyphs")
    monkeypatch.setattr(method.GlyphsMethod, "pixels_a_part", 14 * camera.width)
    in_parts = picture(scene, camera, display, "glyphs")
    np.testing.assert_array_equal(in_parts["ball_id"], whole["ball_id"])
    np.testing.assert_allclose(in_parts["depth"], whole["depth"], rtol=1e-6)


@pytest.mark.parametrize("display", GLYPHS)
def test_what_stays_on_the_device_is_the_same(display):
    scene = SCENES["ten_balls"]()
    balls = scene.balls.with_colors(np.linspace(0, 1, 30).reshape(10, 3))
    camera = scene.camera("perspective")
    request = Request(balls, camera, scene.field, frozenset({"color"}), 0, lambda _: None, display=display)
    method = create_method("glyphs")[1]
    textures, surface = method.find_surface_on_device(request), method.find_surface(request)
    passes = textures.read_back()
    assert textures.passes == ("depth", "normal", "color")
    for name, pixels in passes.items():
        np.testing.assert_array_equal(pixels, getattr(surface, name), err_msg=name)
    assert textures.counts == surface.counts
    textures.release()


@pytest.mark.parametrize("display", GLYPHS)
@pytest.mark.parametrize("method", METHODS)
def test_no_glyphs_give_an_empty_image(method, display):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=8, height=6)
    for balls in (
        meniscus.Balls(np.zeros((0, 3)), 1.0),
        meniscus.Balls([[0, 0, 0]], 1.0, 0.05),
        meniscus.Balls([[0, -9, 0]], 1),
    ):
        image = meniscus.render(balls, camera, meniscus.Field(), method=method, display=display)
        assert not image.hit.any()
        assert np.all(image["depth"] == np.float32(1e10))
        assert np.all(image["normal"] == 0)
