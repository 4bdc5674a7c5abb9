"""Presets: those that come with Meniscus, and the user's own, which are files."""

import importlib
from pathlib import Path

import bpy
import pytest


@pytest.fixture
def own_presets(monkeypatch, tmp_path):
    """A folder of scripts in place of the user's."""
    resource = bpy.utils.user_resource

    def in_temporary_folder(kind, path="", create=False):
        folder = tmp_path / path if kind == "SCRIPTS" else Path(resource(kind, path=path, create=create))
        if create:
            folder.mkdir(parents=True, exist_ok=True)
        return str(folder)

    monkeypatch.setattr(bpy.utils, "user_resource", in_temporary_folder)
    monkeypatch.setattr(bpy.utils, "script_paths", lambda subdir=None, **_: [str(tmp_path / (subdir or ""))])
    return tmp_path / "presets" / "meniscus"


def values(settings):
    names = [item.identifier for item in settings.bl_rna.properties if not item.is_readonly]
    return {name: tuple(value) if hasattr(value := getattr(settings, name), "__len__") else value for name in names}


def test_an_own_preset_gives_back_what_was_kept_and_can_be_removed(meniscus, empty_scene, own_presets):
    settings = empty_scene.meniscus
    bpy.ops.meniscus.apply_preset(preset="mercury")
    settings.light, settings.use_speed_range, settings.speed_max = (0, 0, 1), True, 12.0
    kept = values(settings)
    assert bpy.ops.meniscus.add_preset("EXEC_DEFAULT", name="My Gold") == {"FINISHED"}
    (file,) = own_presets.glob("*.py")
    bpy.ops.meniscus.apply_preset(preset="water")
    settings.use_speed_range, settings.speed_max = False, 1.0
    assert values(settings) != kept
    assert bpy.ops.script.execute_preset(filepath=str(file), menu_idname="MENISCUS_PT_presets") == {"FINISHED"}
    assert values(settings) == kept
    assert bpy.ops.meniscus.add_preset("EXEC_DEFAULT", name="My Gold", remove_name=True) == {"FINISHED"}
    assert not file.exists()


def test_own_presets_keep_all_of_the_look(meniscus):
    panels = importlib.import_module(f"{meniscus.__name__}.addon.blender.panels")
    kept = {value.rpartition(".")[2] for value in panels.MENISCUS_OT_add_preset.preset_values}
    look = {name for names in panels._LOOK_SETTINGS.values() for name in names} | {"style"}
    assert look <= kept


@pytest.mark.parametrize("name", ["water", "slime", "mercury", "molecules"])
def test_a_preset_leaves_nothing_of_the_one_before(meniscus, empty_scene, name):
    """Neither of how viewports are coloured nor of how renders trace light."""
    settings = empty_scene.meniscus
    bpy.ops.meniscus.apply_preset(preset=name)
    expected = values(settings)
    assert settings.use_tracing
    for other in ("water", "slime", "mercury", "molecules"):
        bpy.ops.meniscus.apply_preset(preset=other)
    settings.use_tracing = settings.use_tracing_shadows = False
    settings.tracing_samples, settings.tracing_occlusion_distance, settings.render_style = 7, 3.0, "normal"
    bpy.ops.meniscus.apply_preset(preset=name)
    assert values(settings) == expected
