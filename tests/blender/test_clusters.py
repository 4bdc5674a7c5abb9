"""Connected liquids in Blender: the pass, the colours of sources, and what the statistics say."""

import importlib
import json

import bpy
import numpy as np
import pytest
from exr_files import exr_channels
from fluid_scenes import add_points

DROPS = [(-1.2, 0, 0), (0.6, 0, 0), (1.0, 0, 0), (1.4, 0, 0)]
"""A droplet to the left, and a liquid of three balls to the right."""


def submodule(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.addon.{name}")


@pytest.fixture
def scene(empty_scene):
    """Drops before a parallel camera, in their own colours, without antialiasing."""
    add_points(empty_scene.collection, points=DROPS, radius=0.6)
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", 4.0
    camera = bpy.data.objects.new("Camera", data)
    camera.location, camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    render = empty_scene.render
    render.engine = "MENISCUS"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 24, 100
    render.film_transparent = True
    empty_scene.meniscus.render_samples, empty_scene.meniscus.render_style = 1, "flat"
    return empty_scene


def read(meniscus, **choices):
    """What the render engine, the export and the command line make of the scene."""
    package = submodule(meniscus, "blender.render_scene")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    settings = package.RenderSettings.of(bpy.context.scene, bpy.context.view_layer, **choices)
    scene_render = package.read_view_layer(depsgraph, settings, lambda frame, subframe: None)
    return scene_render.image(package.Control(lambda: False))


def test_the_view_layer_has_a_switch_for_the_pass_and_f12_gives_it(meniscus, scene, tmp_path):
    bpy.context.view_layer.meniscus.use_pass_cluster_id = True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(tmp_path / "frame.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    channels = {name.split(".", 1)[1]: pixels for name, pixels in exr_channels(scene.render.filepath).items()}
    numbers = channels["Cluster ID.X"]
    np.testing.assert_array_equal(numbers, read(meniscus)["cluster_id"])
    assert set(np.unique(numbers[:, :24])) == {-1, 2}
    assert set(np.unique(numbers[:, 24:])) == {-1, 1}


def test_the_command_line_writes_the_pass_and_its_counts(meniscus, scene, tmp_path):
    main = submodule(meniscus, "blender.command_line").main
    output, report = tmp_path / "f_####.exr", tmp_path / "report.json"
    arguments = ["render", "--frames", "1", "--output", str(output), "--passes", "cluster_id", "--json", str(report)]
    assert main(arguments) == 0
    (pixels,) = exr_channels(str(tmp_path / "f_0001.exr")).values()
    assert set(np.unique(pixels)) == {-1, 1, 2}
    counts = json.loads(report.read_text())["frames"][0]["counts"]
    assert (counts["clusters"], counts["largest_cluster"], counts["lone_droplets"]) == (2, 3, 1)


@pytest.mark.parametrize("style", ["flat", "material"])
def test_a_source_takes_the_colours_of_its_liquids(meniscus, scene, style):
    colors = submodule(meniscus, "fluid.palette").numbered_colors(np.array([1, 2]))
    scene.objects["Points"].meniscus.color_mode = "CLUSTER"
    scene.meniscus.render_style = style
    image = read(meniscus, passes=("color", "cluster_id"))
    for number in (1, 2):
        seen = image["color"][image["cluster_id"] == number]
        assert len(seen) > 10
        np.testing.assert_allclose(seen, np.broadcast_to(colors[number - 1], seen.shape), atol=1e-6)


def test_sources_beside_one_with_such_colours_keep_theirs(meniscus, scene):
    scene.objects["Points"].meniscus.color_mode = "CLUSTER"
    other = add_points(scene.collection, "Other", points=[(-1.2, 0, 0.8)], radius=0.6)
    image = read(meniscus, passes=("color", "cluster_id"))
    upper = image["cluster_id"][18:] > 0
    seen = image["color"][18:][upper]
    assert len(seen) > 10
    np.testing.assert_allclose(seen, np.broadcast_to(np.array(scene.meniscus.color), seen.shape), atol=1e-6)
    other.meniscus.color_mode, other.meniscus.color = "FIXED", (1.0, 0.0, 0.0)
    image = read(meniscus, passes=("color", "cluster_id"))
    np.testing.assert_allclose(image["color"][18:][upper], [(1, 0, 0)] * len(seen), atol=1e-6)


def test_the_statistics_name_liquids_only_where_they_are_counted(meniscus, scene):
    lines = submodule(meniscus, "blender.panels").cluster_lines
    assert lines(read(meniscus, passes=("depth",)).info.counts) == []
    counted = lines(read(meniscus, passes=("cluster_id",)).info.counts)
    assert counted == [("Clusters", "2"), ("Largest", "3 balls, 75.0%"), ("Lone Droplets", "1")]
