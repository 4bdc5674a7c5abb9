"""Spheres and ellipsoids in Blender: the scene's setting, F12, and the command line."""

import importlib

import bpy
import numpy as np
import pytest
from exr_files import exr_channels
from fluid_scenes import add_object, add_points, read_balls

LIQUIDS = [(-0.9, 0, 0), (0.3, 0, 0), (0.7, 0, 0.2), (1.1, 0, 0.4)]


def submodule(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.addon.{name}")


@pytest.fixture
def scene(empty_scene):
    """A droplet and a liquid of three balls before a camera, without antialiasing."""
    add_points(empty_scene.collection, points=LIQUIDS, radius=0.6)
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    empty_scene.camera = camera
    render = empty_scene.render
    render.engine = "MENISCUS"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 36, 100
    render.film_transparent = True
    empty_scene.meniscus.render_samples = 1
    return empty_scene


def read(meniscus, **choices):
    """What the render engine, the export and the command line make of the scene."""
    package = submodule(meniscus, "blender.render_scene")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    settings = package.RenderSettings.of(bpy.context.scene, bpy.context.view_layer, **choices)
    return package.read_view_layer(depsgraph, settings, lambda frame, subframe: None), package.Control(lambda: False)


def image_of(meniscus, **choices):
    scene_render, control = read(meniscus, **choices)
    return scene_render.image(control)


def expected(meniscus, scene, display):
    camera = submodule(meniscus, "blender.read_camera").read_camera(bpy.context.evaluated_depsgraph_get())
    field = submodule(meniscus, "blender.read_scene").read_field(scene)
    return meniscus.render(read_balls(meniscus), camera, field, passes=("depth", "normal"), display=display)


@pytest.mark.parametrize("display", ["spheres", "ellipsoids"])
def test_f12_shows_the_display_of_the_scene(meniscus, scene, tmp_path, display):
    assert scene.meniscus.display == "metaballs"
    scene.meniscus.display = display
    bpy.context.view_layer.use_pass_normal = True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(tmp_path / "frame.exr")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    channels = {name.split(".", 1)[1]: pixels for name, pixels in exr_channels(scene.render.filepath).items()}
    image, metaballs = expected(meniscus, scene, display), expected(meniscus, scene, "metaballs")
    assert np.mean(np.abs(image["normal"] - metaballs["normal"]).max(axis=2)[image.hit] > 0.1) > 0.1
    for index, channel in enumerate("XYZ"):
        np.testing.assert_allclose(channels[f"Normal.{channel}"], image["normal"][..., index], atol=1e-5)


def test_the_command_line_can_choose_another(meniscus, scene, tmp_path, capfd):
    main = submodule(meniscus, "blender.command_line").main
    arguments = ["render", "--frames", "1", "--output", str(tmp_path / "f_####.exr"), "--passes", "normal"]
    assert main([*arguments, "--display", "ellipsoids"]) == 0
    found = exr_channels(str(tmp_path / "f_0001.exr"))
    normal = np.stack([next(found[name] for name in found if name.endswith(f"Normal.{axis}")) for axis in "XYZ"], axis=-1)
    np.testing.assert_allclose(normal, expected(meniscus, scene, "ellipsoids")["normal"], atol=1e-5)
    assert main([*arguments, "--display", "spheres", "--method", "tile_caster"]) == 1
    assert "'tile_caster' does not show spheres: leave the method to Meniscus" in capfd.readouterr().err
    assert main([*arguments, "--display", "dots"]) == 2


def test_what_only_metaballs_have_is_one_sentence(meniscus, scene, tmp_path, capfd):
    scene.meniscus.display = "spheres"
    main = submodule(meniscus, "blender.command_line").main
    arguments = ["render", "--frames", "1", "--output", str(tmp_path / "f_####.exr")]
    assert main([*arguments, "--passes", "thickness"]) == 1
    assert "Only metaballs have the pass thickness" in capfd.readouterr().err
    assert main([*arguments, "--deep"]) == 1
    assert "Deep files hold the inside of metaballs" in capfd.readouterr().err


def test_light_that_cannot_be_traced_is_noted_and_the_picture_is_that_without(meniscus, scene):
    """A plane behind is shaded as ever."""
    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata([(-4, 2, -4), (4, 2, -4), (4, 2, 4), (-4, 2, 4)], [], [(0, 1, 2, 3)])
    add_object(scene.collection, "Plane", mesh)
    light = add_object(scene.collection, "Sun", bpy.data.lights.new("Sun", "SUN"))
    light.rotation_euler = (1, 0, 0.3)
    scene.meniscus.display = "spheres"
    plain = image_of(meniscus, passes=("combined",))
    scene.meniscus.use_tracing = True
    traced = image_of(meniscus, passes=("combined",))
    assert traced.info.notes == (submodule(meniscus, "render.renderer").UNTRACED,)
    assert plain.info.notes == ()
    np.testing.assert_array_equal(traced["combined"], plain["combined"])
    assert plain["combined"][..., 3].min() == 1


def test_holdouts_and_mattes_know_the_object_of_a_glyph(meniscus, scene):
    other = add_points(scene.collection, "Other", points=[(-0.9, 0, 1.25)], radius=0.6)
    other.pass_index = 7
    scene.meniscus.display = "ellipsoids"
    image = image_of(meniscus, passes=("object_index", "combined"), cryptomatte_levels=2)
    assert np.count_nonzero(image["object_index"] == 7) > 10
    assert {"Points", "Other"} <= set(image.cryptomatte.names)
    other.is_holdout = True
    bpy.context.view_layer.update()
    hidden = image_of(meniscus, passes=("object_index", "combined"))
    held = image["object_index"] == 7
    assert not hidden["combined"][held].any()
    np.testing.assert_array_equal(hidden["combined"][~held], image["combined"][~held])


def test_the_display_survives_saving(meniscus, scene, tmp_path):
    scene.meniscus.display = "ellipsoids"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "fluid.blend"), check_existing=False)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "fluid.blend"))
    assert bpy.context.scene.meniscus.display == "ellipsoids"
