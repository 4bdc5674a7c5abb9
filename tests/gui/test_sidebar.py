"""As a new user would: select an emitter, one click, it flows. And the panels of the sidebar."""

import importlib
from contextlib import suppress

import bpy
import numpy as np
import pytest
from event_loop import turns, wait_until
from expected import box, is_steady
from fluid_scenes import add_emitter, add_points, play
from fluid_views import FLUID_COLOR
from mathutils import Euler
from pictures import check_same
from viewports import look

CUBE = box((0, 0, 0), 1.0)


@pytest.fixture
def sidebar(new_file, fluid):
    """The sidebar of the first viewport, open at the tab; fails where a panel's drawing fails, by what Blender prints."""
    shown = fluid.prepare()
    shown.space.show_region_ui = True
    turns(3)
    wait_until(lambda: shows_tab(shown.area), "the tab in the sidebar")
    return shown


def shows_tab(area):
    """Open the tab, which is there once the sidebar was drawn."""
    region = next(region for region in area.regions if region.type == "UI")
    region.tag_redraw()
    if region.active_panel_category != "Meniscus":
        with suppress(TypeError):
            region.active_panel_category = "Meniscus"
        return False
    return True


def test_one_click_and_it_flows(fluid, new_file):
    shown = fluid.prepare()
    emitter = add_emitter(bpy.context.scene.collection, particle_size=0.15, count=30)
    emitter.meniscus.use_fluid = False
    emitter.meniscus.property_unset("radius_factor")
    bpy.data.objects["Cube"].hide_set(True)
    look(shown.view, Euler((1.2, 0, 0.4)).to_quaternion(), 8.0)
    play(bpy.context.scene, 12)
    for item in bpy.context.view_layer.objects:
        item.select_set(item == emitter)
    with shown.override():
        assert bpy.ops.meniscus.add_sources() == {"FINISHED"}
    fluid.check_presence("one_click", shown)
    before = shown.picture()
    bpy.context.scene.frame_set(20)
    fluid.check_presence("one_click_flows", shown)
    assert not np.array_equal(before, shown.picture())
    with shown.override():
        bpy.ops.ed.undo_push(message="Use as Fluid")
        assert bpy.ops.meniscus.remove_source() == {"FINISHED"}
    fluid.check_absence("one_click_removed", shown)


def test_panels_of_the_sidebar_draw(drawn_panels, fluid, sidebar):
    wait_until(lambda: "MENISCUS_PT_sidebar" in drawn_panels, "the sidebar")
    assert "MENISCUS_PT_sidebar_source" not in drawn_panels
    add_points(bpy.context.scene.collection, points=[(2, 0, 0)], radius=1.0)
    rest = {f"MENISCUS_PT_sidebar_{name}" for name in ("source", "look", "surface", "quality", "statistics")}
    wait_until(lambda: rest <= set(drawn_panels), "all panels of the sidebar")


@pytest.mark.parametrize(
    ("search", "sorted_by_name", "expected"),
    [("", False, ["Splash", "Drop"]), ("", True, ["Drop", "Splash"]), ("spl", False, ["Splash"])],
)
def test_the_list_has_sources_only_and_can_be_searched_and_sorted(
    meniscus, monkeypatch, fluid, sidebar, search, sorted_by_name, expected
):
    sources_list = importlib.import_module(f"{meniscus.__name__}.addon.blender.panels").MENISCUS_UL_sources
    draw, draw_filter, filter_items = sources_list.draw_item, sources_list.draw_filter, sources_list.filter_items
    rows, is_drawn = [], []

    # Blender counts the arguments of what it calls.
    def recorded(self, context, layout, data, item, icon, active_data, active_property):
        rows.append(item.name)
        draw(self, context, layout, data, item, icon, active_data, active_property)

    def recorded_filter(self, context, layout):
        draw_filter(self, context, layout)
        is_drawn.append(True)

    def searched(self, context, data, name):
        self.use_filter_show, self.filter_name, self.use_filter_sort_alpha = True, search, sorted_by_name
        return filter_items(self, context, data, name)

    monkeypatch.setattr(sources_list, "draw_item", recorded)
    monkeypatch.setattr(sources_list, "draw_filter", recorded_filter)
    monkeypatch.setattr(sources_list, "filter_items", searched)
    for name in ("Splash", "Drop"):
        add_points(bpy.context.scene.collection, name, points=[(2, 0, 0)], radius=1.0)
    fluid.settled(sidebar)
    rows.clear()
    next(region for region in sidebar.area.regions if region.type == "UI").tag_redraw()
    wait_until(lambda: rows and is_drawn, "the list")
    assert rows[: len(expected)] == expected
    assert set(rows) == set(expected)


def test_the_presets_open(drawn_panels, fluid, sidebar, meniscus):
    with sidebar.override():
        bpy.ops.wm.call_panel(name="MENISCUS_PT_presets")
    wait_until(lambda: "MENISCUS_PT_presets" in drawn_panels, "the presets")


@pytest.mark.parametrize("style", ["studio", "water", "material", "headlight", "flat", "normal", "depth", "speed", "id"])
def test_each_look_draws_with_its_panel(drawn_panels, fluid, sidebar, style):
    add_points(bpy.context.scene.collection, points=[(2, 0, 0)], radius=1.0)
    fluid.settled(sidebar)
    flat = sidebar.picture()
    drawn_panels.clear()
    bpy.context.scene.meniscus.style = style
    wait_until(lambda: "MENISCUS_PT_sidebar_look" in drawn_panels, "the panel of the look")
    other = fluid.settled(sidebar)
    is_other = (flat != other).any(axis=2) & is_steady(flat)
    assert is_other.any() == (style != "flat")


def test_a_look_needs_no_new_image_where_the_old_one_has_all_of_it(fluid, new_file):
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=[(2, 0, 0)], radius=1.0)
    before = fluid.settled(shown)
    (live,) = fluid.lives()
    revision, reads = live.revision, fluid.module("viewport")._drawing._scene_balls.reads
    for name, value in (("style", "normal"), ("style", "studio"), ("roughness", 0.9)):
        setattr(bpy.context.scene.meniscus, name, value)
        after = fluid.settled(shown)
        assert not np.array_equal(before, after), name
        before = after
    assert fluid.module("viewport")._drawing._scene_balls.reads == reads
    bpy.context.scene.meniscus.color = (1.0, 0.2, 0.0)
    assert not np.array_equal(before, fluid.settled(shown))
    assert live.revision == revision


def test_depth_contrast_shows(fluid, new_file):
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=[(2, 0, 0), (2.6, 1.6, 0)], radius=1.0)
    settings = bpy.context.scene.meniscus
    settings.style = "studio"
    plain = fluid.settled(shown)
    settings.depth_contrast = 6.0
    assert np.abs(fluid.settled(shown).astype(int) - plain).max() > 15
    settings.depth_contrast = 0.0
    check_same("without_contrast", fluid.settled(shown), plain, is_steady(plain), tolerance=0)


def test_a_problem_is_shown_and_can_be_copied(drawn_panels, fluid, sidebar):
    item = add_points(bpy.context.scene.collection, points=[(2, 0, 0)], radius=1.0)
    fluid.settled(sidebar)
    drawn_panels.clear()
    item.meniscus.radius_mode, item.meniscus.radius_attribute = "ATTRIBUTE", "nowhere"
    wait_until(lambda: "nowhere" in fluid.status.problem and "MENISCUS_PT_sidebar" in drawn_panels, "the problem in the panel")
    with sidebar.override():
        assert bpy.ops.meniscus.copy_problem() == {"FINISHED"}
    assert "nowhere" in bpy.context.window_manager.clipboard
    item.meniscus.radius_attribute = "radius"
    wait_until(lambda: not fluid.status.problem, "the end of the problem")


def test_antialiasing_covers_edge_pixels_by_their_share(fluid, new_file):
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=[(0, 0, 0)], radius=3.0)
    bpy.data.objects["Cube"].hide_set(True)
    settings = bpy.context.scene.meniscus
    settings.preview_samples = 16
    picture = fluid.settled(shown)
    share = shares(picture, shown)
    finer = 4
    width, height = shown.region.width, shown.region.height
    inside = fluid.is_fluid(shown.clip_from_world, (height * finer, width * finer))
    expected = inside.reshape(height, finer, width, finer).mean(axis=(1, 3))
    edge = (expected > 0.2) & (expected < 0.8)
    assert edge.sum() > 200
    assert np.abs(share - expected)[edge].mean() < 0.1
    settings.preview_samples = 1
    aliased = shares(fluid.settled(shown), shown)
    assert np.abs(aliased - expected)[edge].mean() > 0.2


def shares(picture, shown):
    """(height, width): how much of a pixel is fluid, by its blue in linear light."""
    blue = (picture[..., 2] / 255.0) ** 2.2
    background = np.median(blue[40:60, 40:60])
    return (blue - background) / (FLUID_COLOR[2] - background)


@pytest.mark.skipif(bpy.app.version >= (4, 4), reason="newer ones have the depth of meshes")
def test_fluid_shows_where_blender_has_no_depth(fluid, new_file):
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=[(2.5, 0, 0)], radius=1.0)
    shown.space.overlay.show_overlays = False
    shown.space.shading.type = "MATERIAL"
    fluid.check_presence("without_depth", shown)
