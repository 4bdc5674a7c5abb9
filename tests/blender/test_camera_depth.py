"""Depth is that of Cycles: its Depth pass of exact spheres agrees with that of balls whose kernel spheres they are."""

import importlib

import bpy
import numpy as np
import pytest
from cycles_depth import add_spheres, cycles_depth

RADIUS = 0.4


def depth_of_balls(meniscus, centres, method="tile_caster"):
    """(height, width): the Depth pass of balls that look like spheres of `RADIUS`, too far apart to blend."""
    field = meniscus.Field("quartic", 0.25)
    balls = meniscus.Balls(centres, RADIUS / np.sqrt(0.5))
    return meniscus.render(balls, read_camera(meniscus), field, method=method, passes=("depth",))["depth"]


def build(scene, kind):
    """Spheres across the view and beyond its clip end; a shifted, scaled camera and pixels that are not square."""
    data = bpy.data.cameras.new("Camera")
    data.type = kind
    data.lens, data.ortho_scale, data.sensor_fit = 30.0, 6.0, "VERTICAL"
    data.shift_x, data.shift_y = 0.1, -0.05
    data.clip_start, data.clip_end = 0.5, 9.0
    camera = bpy.data.objects.new("Camera", data)
    camera.location, camera.rotation_euler, camera.scale = (0.5, -6.0, 1.0), (1.45, 0.1, 0.05), (2.0, 2.0, 2.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 321, 201, 50
    scene.render.pixel_aspect_y = 1.25
    lattice = np.stack(np.meshgrid(np.arange(-3, 3.1, 1.5), np.arange(-3, 6, 1.5), np.arange(-2, 3.1, 1.5)), axis=-1)
    jitter = np.random.default_rng(3).uniform(-0.15, 0.15, lattice.shape)
    centres = (lattice + jitter).reshape(-1, 3).astype(np.float32)
    add_spheres(scene, centres, RADIUS)
    return centres


def read_camera(meniscus):
    reader = importlib.import_module(meniscus.__name__ + ".addon.blender.read_camera")
    return reader.read_camera(bpy.context.evaluated_depsgraph_get())


def assert_same_depth(actual, expected):
    assert actual.shape == expected.shape
    hit, expected_hit = actual < 1e9, expected < 1e9
    both = hit & expected_hit
    assert np.count_nonzero(both) > 0.1 * both.size
    # Rays that pass an outline by less than Cycles' jitter may differ. A border that is off by a pixel differs in far more.
    assert np.count_nonzero(hit != expected_hit) <= 0.001 * np.count_nonzero(both)
    relative = np.abs(actual[both] / expected[both] - 1)
    assert np.mean(relative <= 1e-4) >= 0.999, f"only {np.mean(relative <= 1e-4):.5f} of the pixels agree"


def test_cycles_writes_what_meniscus_writes_where_there_is_nothing(meniscus, empty_scene, tmp_path):
    passes = importlib.import_module(meniscus.__name__ + ".addon.fluid.passes")
    build(empty_scene, "PERSP")
    depth = cycles_depth(empty_scene, tmp_path)
    assert set(np.unique(depth[depth > 1e9])) == {np.float32(passes.DEPTH_BACKGROUND)}


@pytest.mark.parametrize("method", ["tile_caster", "depth_peeling"])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_depth_agrees_with_cycles(meniscus, empty_scene, tmp_path, kind, method):
    centres = build(empty_scene, kind)
    expected = cycles_depth(empty_scene, tmp_path)
    assert_same_depth(depth_of_balls(meniscus, centres, method), expected)


@pytest.mark.parametrize("use_crop", [False, True])
def test_render_border_agrees_with_cycles(meniscus, empty_scene, tmp_path, use_crop):
    centres = build(empty_scene, "PERSP")
    render = empty_scene.render
    render.use_border, render.use_crop_to_border = True, use_crop
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.213, 0.797, 0.331, 0.899
    expected = cycles_depth(empty_scene, tmp_path)
    assert (read_camera(meniscus).region is None) == use_crop
    assert_same_depth(depth_of_balls(meniscus, centres), expected)
