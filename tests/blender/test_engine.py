"""The render engine: what F12 gives is what the package renders."""

import importlib

import bpy
import numpy as np
import pytest
from exr_files import exr_channels
from fluid_scenes import add_points, read_balls

SIZE = (48, 36)


@pytest.fixture
def scene(empty_scene):
    """A scene with a few balls before a camera, rendered by Meniscus, without view transform."""
    add_points(empty_scene.collection, points=[(0, 0, 0), (0.6, 0, 0.2), (-0.3, 0.4, 0)], radius=1.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    render = empty_scene.render
    render.engine = "MENISCUS"
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    render.film_transparent = True
    empty_scene.meniscus.render_samples, empty_scene.meniscus.render_style = 4, "headlight"
    for name in ("use_pass_z", "use_pass_normal", "use_pass_position"):
        setattr(bpy.context.view_layer, name, True)
    for name in ("use_pass_color", "use_pass_velocity", "use_pass_ball_id"):
        setattr(bpy.context.view_layer.meniscus, name, True)
    return empty_scene


@pytest.fixture
def rendered(scene, tmp_path):
    """Renders as F12 does, and reads the passes back from the multilayer file that Blender writes; by name of the pass."""

    def render(whole_names=False):
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):  # since 5.0
            settings.media_type = "MULTI_LAYER_IMAGE"
        if hasattr(settings, "use_exr_interleave"):  # else a part for each pass
            settings.use_exr_interleave = True
        settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
        scene.render.filepath = str(tmp_path / "frame.exr")
        assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
        channels = exr_channels(scene.render.filepath)
        return channels if whole_names else {name.split(".", 1)[1]: pixels for name, pixels in channels.items()}

    return render


def expected(meniscus, scene, **changes):
    package = meniscus.__name__
    read_camera = importlib.import_module(f"{package}.addon.blender.read_camera").read_camera
    reader = importlib.import_module(f"{package}.addon.blender.read_scene")
    camera = read_camera(bpy.context.evaluated_depsgraph_get())
    passes = ("combined", "depth", "normal", "position", "color", "velocity", "ball_id")
    return meniscus.render(
        read_balls(meniscus),
        camera,
        reader.read_field(scene),
        passes=passes,
        look=reader.read_look(scene, scene.meniscus.render_style),
        **changes,
    )


def test_frames_of_an_animation_are_one_sequence(meniscus, scene, tmp_path, monkeypatch):
    """So that surface particles go on from frame to frame, and let go of what they keep when it is over."""
    package = f"{meniscus.__name__}.addon"
    render_scene, engine = (importlib.import_module(f"{package}.blender.{name}") for name in ("render_scene", "engine"))
    instants, plain = [], render_scene.render

    def noting(*arguments, instant, **options):
        instants.append(instant)
        return plain(*arguments, instant=instant, **options)

    monkeypatch.setattr(render_scene, "render", noting)
    scene.frame_start, scene.frame_end, scene.render.fps = 3, 4, 25
    scene.render.filepath = str(tmp_path / "frame_")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    assert {round(25 * instant.seconds) for instant in instants} == {3, 4}
    assert len({instant.sequence for instant in instants}) == 1
    assert not engine._sequences


def test_passes_are_those_of_the_package(meniscus, scene, rendered):
    passes, image = rendered(), expected(meniscus, scene)
    for name, channels in (("Normal", "XYZ"), ("Position", "XYZ"), ("Color", "RGB"), ("Velocity", "XYZ")):
        for index, channel in enumerate(channels):
            np.testing.assert_allclose(passes[f"{name}.{channel}"], image[name.lower()][..., index], atol=1e-5)
    np.testing.assert_allclose(passes["Depth.Z" if "Depth.Z" in passes else "Depth.V"], image["depth"], rtol=1e-6)
    np.testing.assert_array_equal(passes["Ball ID.X"], image["ball_id"])
    assert image.hit.mean() > 0.1


def test_combined_is_antialiased_and_data_are_not(meniscus, scene, rendered):
    passes, image = rendered(), expected(meniscus, scene)
    alpha = passes["Combined.A"]
    assert set(np.unique(image["combined"][..., 3])) == {0, 1}
    assert len(np.unique(alpha)) == scene.meniscus.render_samples + 1
    inside = np.all([np.roll(image.hit, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0)
    np.testing.assert_allclose(alpha[inside], 1)
    scene.meniscus.render_samples = 1
    once = rendered()
    for index, channel in enumerate("RGBA"):
        np.testing.assert_allclose(once[f"Combined.{channel}"], image["combined"][..., index], atol=1e-5)


@pytest.mark.parametrize("crop", [False, True])
def test_border(meniscus, scene, rendered, crop):
    whole = rendered()
    scene.render.use_border, scene.render.use_crop_to_border = True, crop
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
    scene.render.border_min_y, scene.render.border_max_y = 0.0, 0.5
    part = rendered()["Normal.Y"]
    inside = np.s_[0:18, 12:36]
    np.testing.assert_allclose(part if crop else part[inside], whole["Normal.Y"][inside], atol=1e-5)
    if not crop:
        assert not part[18:].any()


def test_without_a_camera_one_sentence_says_so(scene):
    scene.camera = None
    with pytest.raises(RuntimeError, match="camera"):
        bpy.ops.render.render()


def test_an_unexpected_error_reaches_the_user(meniscus, scene, monkeypatch):
    engine = importlib.import_module(f"{meniscus.__name__}.addon.blender.render_scene")

    def fail(*_arguments, **_settings):
        raise ValueError("nobody expected this")

    monkeypatch.setattr(engine, "read_parts", fail)
    with pytest.raises(RuntimeError, match="nobody expected this"):
        bpy.ops.render.render()


def test_animated_settings_count(scene, rendered):
    settings = scene.meniscus
    settings.render_style, settings.color = "flat", (1, 0, 0)
    settings.keyframe_insert("color", frame=1)
    settings.color = (0, 0, 1)
    settings.keyframe_insert("color", frame=11)
    scene.frame_set(11)
    settings.color = (0, 1, 0)  # not what the animation says
    passes = rendered()
    inside = passes["Combined.A"] == 1
    assert inside.any()
    assert (passes["Combined.B"][inside].min(), passes["Combined.G"][inside].max()) == (1, 0)


def test_animated_colors_of_world_and_materials_count(scene, rendered):
    scene.meniscus.render_style, scene.render.film_transparent, scene.world = "material", False, bpy.data.worlds.new("World")
    material = bpy.data.materials.new("Glow")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = material.use_nodes = True
    bpy.data.objects["Points"].data.materials.append(material)
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    surface = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    surface.inputs["Emission Strength"].default_value, surface.inputs["IOR"].default_value = 1.0, 1.0
    surface.inputs["Base Color"].default_value = (0, 0, 0, 1)
    for entry, color in ((background.inputs["Color"], (0, 0, 1, 1)), (surface.inputs["Emission Color"], (1, 0, 0, 1))):
        entry.default_value = color
        entry.keyframe_insert("default_value", frame=1)
        entry.default_value = (0, 1, 0, 1)
        entry.keyframe_insert("default_value", frame=11)
    scene.frame_set(6)
    for entry in (background.inputs["Color"], surface.inputs["Emission Color"]):
        entry.default_value = (0, 0, 0, 1)  # not what the animation says
    passes = rendered()
    middle, corner = (SIZE[1] // 2, SIZE[0] // 2), (0, 0)
    assert passes["Combined.R"][middle] == pytest.approx(passes["Combined.G"][middle], abs=0.1)
    assert passes["Combined.B"][corner] == pytest.approx(passes["Combined.G"][corner], abs=0.1)
    assert passes["Combined.R"][middle] > 0.3 < passes["Combined.B"][corner]


def test_an_animation_renders_each_frame_anew(scene, tmp_path):
    item = bpy.data.objects["Points"]
    item.location.x = -1
    item.keyframe_insert("location", frame=1)
    item.location.x = 1
    item.keyframe_insert("location", frame=3)
    scene.frame_start, scene.frame_end = 1, 3
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode = "PNG", "RGBA"
    scene.render.filepath = str(tmp_path / "f_")
    bpy.ops.render.render(animation=True)
    contents = {path.read_bytes() for path in tmp_path.glob("f_*.png")}
    assert len(contents) == 3


def test_the_world_is_behind_unless_film_is_transparent(scene, rendered):
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (0.1, 0.2, 0.4, 1), 2.0
    scene.render.film_transparent = False
    passes = rendered()
    np.testing.assert_allclose([passes[f"Combined.{channel}"][0, 0] for channel in "RGBA"], [0.2, 0.4, 0.8, 1], rtol=1e-6)
    assert passes["Depth.Z"][0, 0] > 1e9
    bpy.context.view_layer.use_sky = False
    assert rendered()["Combined.A"][0, 0] == 0


def test_each_view_layer_has_its_own_passes_and_objects(scene, rendered):
    other = bpy.data.collections.new("Other")
    scene.collection.children.link(other)
    add_points(other, "Other", points=[(0, 0, 1.2)], radius=0.8)
    second = scene.view_layers.new("Second")
    second.use_pass_z = False
    second.meniscus.use_pass_speed = True
    scene.view_layers[0].layer_collection.children["Other"].exclude = True
    passes = rendered(whole_names=True)
    assert {"ViewLayer.Depth.Z", "Second.Speed.X"} <= passes.keys()
    assert not {"Second.Depth.Z", "ViewLayer.Speed.X"} & passes.keys()
    assert passes["Second.Combined.A"].sum() > passes["ViewLayer.Combined.A"].sum()


def test_a_holdout_leaves_a_hole(scene, rendered):
    scene.render.film_transparent = False
    scene.world = bpy.data.worlds.new("World")
    bpy.data.objects["Points"].is_holdout = True
    passes = rendered()
    assert passes["Combined.A"].min() == 0
    assert passes["Depth.Z"].min() > 1e9


@pytest.mark.parametrize(("position", "sides"), [("START", {"after"}), ("CENTER", {"before", "after"}), ("END", {"before"})])
def test_motion_blur(scene, rendered, position, sides):
    """Fluid that flies to the right is seen where it is while the shutter is open."""
    item = bpy.data.objects["Points"]
    for frame in (1, 11):
        item.location.x = (frame - 6) * 0.4
        item.keyframe_insert("location", frame=frame)
    fcurves = item.animation_data.action
    fcurves = fcurves.fcurves if hasattr(fcurves, "fcurves") else fcurves.layers[0].strips[0].channelbags[0].fcurves
    for point in (point for curve in fcurves for point in curve.keyframe_points):
        point.interpolation = "LINEAR"
    scene.frame_set(6)
    sharp = rendered()
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, 1.0, position
    blurred = rendered()
    alpha, covered = blurred["Combined.A"], np.nonzero(sharp["Combined.A"].max(axis=0))[0]
    seen = np.nonzero(alpha.max(axis=0))[0]
    assert ("before" in sides) == (seen.min() < covered.min())
    assert ("after" in sides) == (seen.max() > covered.max())
    assert alpha.sum() == pytest.approx(sharp["Combined.A"].sum(), rel=0.05)
    np.testing.assert_array_equal(blurred["Depth.Z"], sharp["Depth.Z"])
    assert (scene.frame_current, scene.frame_subframe) == (6, 0)


def test_coverage_of_mattes_is_antialiased(scene, rendered):
    bpy.context.view_layer.use_pass_cryptomatte_object = True
    passes = rendered()
    np.testing.assert_allclose(passes["CryptoObject00.g"], passes["Combined.A"], atol=1e-6)
    assert len(np.unique(passes["CryptoObject00.g"])) > 3
    assert not passes["CryptoObject00.a"].any()
