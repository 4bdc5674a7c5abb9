"""Rays and planar depth are those of Cycles: its Depth pass of exact spheres agrees with an intersection in closed form."""

import importlib

import bpy
import numpy as np
import pytest
from cycles_depth import add_spheres, cycles_depth

RADIUS = 0.4


def depth_of_spheres(camera, centres):
    """(height, width) planar depth of the nearest front of spheres, in the camera's whole image; infinite where none is."""
    origins, directions = camera.view_rays()
    view_centres = centres @ camera.view_from_world[:3, :3].T + camera.view_from_world[:3, 3]
    nearest = np.full(origins.shape[:2], np.inf)
    for centre in view_centres:
        to_centre = centre - origins
        squared_length = np.sum(directions**2, axis=-1)
        middle = np.sum(directions * to_centre, axis=-1) / squared_length
        closest_squared = np.sum((to_centre - middle[..., None] * directions) ** 2, axis=-1)
        half_squared = (RADIUS**2 - closest_squared) / squared_length
        front = middle - np.sqrt(np.maximum(half_squared, 0))
        hit = (half_squared > 0) & (front > camera.clip_start) & (front < camera.clip_end)
        nearest = np.where(hit, np.minimum(nearest, front), nearest)
    depth = np.full((camera.height, camera.width), np.inf)
    region = camera.active_region
    depth[region.y_min : region.y_max, region.x_min : region.x_max] = nearest
    return depth


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
    centres = np.random.default_rng(3).uniform((-3, -3, -2), (3, 5, 3), (40, 3)).astype(np.float32)
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


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_depth_agrees_with_cycles(meniscus, empty_scene, tmp_path, kind):
    centres = build(empty_scene, kind)
    expected = cycles_depth(empty_scene, tmp_path)
    assert_same_depth(depth_of_spheres(read_camera(meniscus), centres), expected)


@pytest.mark.parametrize("use_crop", [False, True])
def test_render_border_agrees_with_cycles(meniscus, empty_scene, tmp_path, use_crop):
    centres = build(empty_scene, "PERSP")
    render = empty_scene.render
    render.use_border, render.use_crop_to_border = True, use_crop
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.213, 0.797, 0.331, 0.899
    expected = cycles_depth(empty_scene, tmp_path)
    camera = read_camera(meniscus)
    assert (camera.region is None) == use_crop
    assert_same_depth(depth_of_spheres(camera, centres), expected)
