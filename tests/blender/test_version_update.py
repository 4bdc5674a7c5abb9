"""Files of other versions of the settings, and settings that go with what is appended and linked."""

import importlib

import bpy
import pytest
from fluid_scenes import add_points

pytestmark = pytest.mark.usefixtures("empty_scene")


@pytest.fixture
def version_update(meniscus):
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.version_update")


@pytest.fixture
def saved(version_update, tmp_path, monkeypatch):
    """Saves the open file as a version that marks none would, and opens it again."""

    def save_and_open(version=0):
        path = str(tmp_path / "file.blend")
        bpy.app.handlers.save_pre.remove(version_update._mark)
        try:
            bpy.context.scene.meniscus.version = version
            bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False)
        finally:
            bpy.app.handlers.save_pre.append(version_update._mark)
        bpy.ops.wm.open_mainfile(filepath=path)
        return bpy.context.scene

    return save_and_open


def test_a_file_from_before_there_were_styles_looks_as_it_did(saved):
    add_points(bpy.context.scene.collection)
    scene = saved()
    assert (scene.meniscus.style, scene.meniscus.version) == ("headlight", 1)


def test_a_style_that_was_set_stays(saved):
    bpy.context.scene.meniscus.style = "water"
    assert saved().meniscus.style == "water"


def test_a_file_that_never_saw_meniscus_gets_what_is_new(saved):
    scene = saved()
    assert (scene.meniscus.style, scene.meniscus.version) == ("studio", 1)


def test_newer_files_are_left_alone(saved):
    add_points(bpy.context.scene.collection)
    scene = saved(version=99)
    assert (scene.meniscus.style, scene.meniscus.version) == ("studio", 99)


def test_what_is_saved_now_is_not_taken_for_old(tmp_path):
    add_points(bpy.context.scene.collection)
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert (bpy.context.scene.meniscus.style, bpy.context.scene.meniscus.version) == ("studio", 1)


@pytest.mark.parametrize("link", [False, True])
def test_settings_go_with_what_is_appended_and_linked(tmp_path, link):
    item = add_points(bpy.context.scene.collection, "Drop")
    item.meniscus.radius_mode, item.meniscus.radius = "FIXED", 0.75
    bpy.context.scene.meniscus.style = "id"
    bpy.context.scene.name = "Wet"
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(path, link=link) as (_, wanted):
        wanted.objects, wanted.scenes = ["Drop"], ["Wet"]
    settings = bpy.data.objects["Drop"].meniscus
    assert (settings.use_fluid, settings.radius_mode, settings.radius) == (True, "FIXED", 0.75)
    assert bpy.data.scenes["Wet"].meniscus.style == "id"


@pytest.mark.skipif(not hasattr(bpy.app.handlers, "blend_import_post"), reason="Blender tells of imports since 4.3")
def test_an_old_scene_that_is_appended_looks_as_it_did_and_new_scenes_stay_new(saved, version_update, tmp_path):
    add_points(bpy.context.scene.collection)
    bpy.context.scene.name = "Old"
    path = str(tmp_path / "file.blend")
    saved()
    bpy.data.scenes["Old"].meniscus.property_unset("style")
    bpy.data.scenes["Old"].meniscus.version = 0
    bpy.app.handlers.save_pre.remove(version_update._mark)
    bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False)
    bpy.app.handlers.save_pre.append(version_update._mark)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    new = bpy.data.scenes.new("New")
    add_points(new.collection)
    bpy.ops.wm.append(directory=f"{path}/Scene/", filename="Old")
    assert bpy.data.scenes["Old"].meniscus.style == "headlight"
    assert new.meniscus.style == "studio"


def test_settings_animate_and_take_drivers(meniscus):
    scene = bpy.context.scene
    settings = scene.meniscus
    settings.isovalue = 0.1
    settings.keyframe_insert("isovalue", frame=1)
    settings.isovalue = 0.5
    settings.keyframe_insert("isovalue", frame=11)
    driver = scene.driver_add("meniscus.roughness").driver
    driver.expression = "frame / 100"
    scene.frame_set(6)
    reader = importlib.import_module(f"{meniscus.__name__}.addon.blender.read_scene")
    assert 0.2 < reader.read_field(scene).isovalue < 0.4
    assert reader.read_look(scene, scene.meniscus.style).roughness == pytest.approx(0.06)
