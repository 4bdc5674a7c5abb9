"""Tables that stand for Blender's view transforms."""

import importlib

import bpy
import numpy as np
import pytest


@pytest.fixture
def view_transform(meniscus, empty_scene):
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.view_transform")


def looked_up(table, colors, module):
    """(count, 3): colours through a table, between its cells, as lib/display.glsl does it."""
    size, offset = module.TABLE_SIZE, module._OFFSET
    place = (np.log2((np.maximum(colors, 0) + offset) / (1 + offset)) - module._LOW) / (module._HIGH - module._LOW)
    position = np.clip(place, 0, 1) * (size - 1)
    low = np.minimum(position.astype(int), size - 2)
    share = position - low
    code = np.zeros_like(colors)
    for corner in range(8):
        side = np.array([corner & 1, corner >> 1 & 1, corner >> 2])
        weight = np.where(side, share, 1 - share).prod(axis=1)
        cell = low + side
        code += weight[:, None] * table[cell[:, 2], cell[:, 0] + size * cell[:, 1]]
    return code


@pytest.mark.parametrize("name", ["Standard", "Filmic", "AgX"])
def test_a_table_gives_what_blender_gives(view_transform, empty_scene, name):
    settings = ("sRGB", name, "None", None, None)
    table = view_transform._converted(view_transform._table_colors(), empty_scene, settings)
    rng = np.random.default_rng(3)
    colors = (rng.uniform(0, 1, (40, 50, 3)) ** 2 * rng.uniform(0, 6, (40, 50, 1))).astype(np.float32)
    expected = view_transform._converted(colors, empty_scene, settings).reshape(-1, 3)
    actual = looked_up(table, colors.reshape(-1, 3).astype(np.float64), view_transform)
    difference = 255 * np.abs(actual - expected).max(axis=1)
    assert expected.std() > 0.1
    assert difference.mean() < 0.4
    assert np.percentile(difference, 99) < 2.5


def test_what_counts_goes_by_the_kind_of_shading(view_transform, empty_scene):
    view = empty_scene.view_settings
    view.view_transform, view.exposure, view.gamma = "AgX", 1.5, 1.2
    shading = next(area for area in bpy.data.screens[0].areas if area.type == "VIEW_3D").spaces.active.shading
    taken = view_transform._taken_settings
    shading.type = "SOLID"
    assert taken(empty_scene, shading) == (("sRGB", "Standard", "None", None, None), 0.0, 1.0)
    shading.type = "MATERIAL"
    shading.use_scene_lights = shading.use_scene_world = False
    assert taken(empty_scene, shading) == (("sRGB", "AgX", "None", None, None), 0.0, 1.0)
    shading.use_scene_lights = True
    assert taken(empty_scene, shading) == (("sRGB", "AgX", "None", None, None), 1.5, pytest.approx(1.2))
    view.use_curve_mapping = True
    key, exposure, _ = taken(empty_scene, shading)
    assert exposure == 0.0
    assert key[4][1] == 1.5


def test_a_transform_stays_the_same_and_its_table_comes_later(view_transform, empty_scene):
    transforms = view_transform.ViewTransforms()
    shading = next(area for area in bpy.data.screens[0].areas if area.type == "VIEW_3D").spaces.active.shading
    shading.type = "MATERIAL"
    empty_scene.view_settings.view_transform = "Filmic"
    first = transforms.of(empty_scene, shading)
    assert first.table is None
    assert transforms.of(empty_scene, shading) is first
    assert transforms.has_missing
    names = set(bpy.data.scenes.keys())
    transforms.make_missing()
    assert set(bpy.data.scenes.keys()) == names
    assert transforms.of(empty_scene, shading).table is not None
    assert not transforms.has_missing


def test_where_no_table_can_be_made_one_sentence_says_so(view_transform, empty_scene, monkeypatch):
    def fail(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(view_transform, "_converted", fail)
    transforms = view_transform.ViewTransforms()
    shading = next(area for area in bpy.data.screens[0].areas if area.type == "VIEW_3D").spaces.active.shading
    shading.type = "MATERIAL"
    empty_scene.view_settings.view_transform = "Filmic"
    transforms.of(empty_scene, shading)
    transforms.make_missing()
    assert "Filmic" in transforms.problem
    assert "no space left" in transforms.problem
    assert transforms.of(empty_scene, shading).table is None
    assert not transforms.has_missing
