"""A user's hand: what the X server reports of a mouse and a keyboard, while the fluid is drawn."""

import subprocess

import bpy
import numpy as np
import pytest
from event_loop import turns, wait_until
from fluid_scenes import add_emitter, add_points
from hand import act, needs_hand
from mathutils import Euler
from viewports import look, region_picture

pytestmark = needs_hand


@pytest.fixture
def drop(new_file, fluid):
    """The first viewport, with a fluid and no cube; the mouse is in its middle."""
    shown = fluid.prepare()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    add_points(bpy.context.scene.collection, "Drop", [(0, 0, 0), (1.5, 0, 0), (0, 0.4, 0.5)], radius=1.0)
    look(shown.view, Euler((1.0, 0, 0.5)).to_quaternion(), 9.0)
    fluid.check_presence("before_events", shown)
    act("mousemove", *middle(shown.window, shown.region))
    return shown


def middle(window, region):
    return on_screen(window, region, region.width // 2, region.height // 2)


def on_screen(window, region, x, y):
    """Where xdotool sees a pixel of a region; it counts from the screen's top."""
    height = screen_height()
    return window.x + region.x + x, height - 1 - (window.y + region.y + y)


def screen_height():
    words = subprocess.run(["xdotool", "getdisplaygeometry"], check=True, capture_output=True, text=True).stdout
    return int(words.split()[1])


def test_dragging_orbits(fluid, drop):
    before = drop.view.view_rotation.copy()
    act("mousedown", 2)
    for _ in range(20):
        act("mousemove_relative", 6, 2)
    act("mouseup", 2)
    assert drop.view.view_rotation.rotation_difference(before).angle > 0.3
    fluid.check_presence("dragged", drop)


def test_the_space_bar_plays(fluid, drop):
    emitter = add_emitter(bpy.context.scene.collection, count=20, normal_factor=4, particle_size=0.2)
    emitter.show_instancer_for_viewport = False
    act("key", "space")
    wait_until(lambda: bpy.context.screen.is_animation_playing and bpy.context.scene.frame_current > 15, "frame 15")
    act("key", "space")
    wait_until(lambda: not bpy.context.screen.is_animation_playing, "the end of playing")
    fluid.check_presence("played", drop)


def test_a_click_makes_an_object_fluid(fluid, drop):
    item = bpy.data.objects["Drop"]
    bpy.context.view_layer.objects.active = item
    turns(2)
    editor = next(area for area in drop.window.screen.areas if area.type == "PROPERTIES")
    editor.spaces.active.context = "OBJECT"
    region = next(region for region in editor.regions if region.type == "WINDOW")
    turns(3)
    with bpy.context.temp_override(window=drop.window, area=editor, region=region):
        bpy.ops.view2d.scroll_down(page=True)  # ours is the last panel
    checked = settled_picture(drop.window, region)
    item.meniscus.use_fluid = False
    unchecked = settled_picture(drop.window, region)
    fluid.check_absence("unchecked", drop)
    # What changes in the panel is the check box.
    y, x = np.argwhere((checked != unchecked).any(axis=2)).mean(axis=0)
    act("mousemove", *on_screen(drop.window, region, round(x), round(y)), "click", 1)
    wait_until(lambda: item.meniscus.use_fluid, "the click to be heard")
    act("mousemove", *middle(drop.window, drop.region))
    fluid.check_presence("clicked", drop)


def settled_picture(window, region):
    region.tag_redraw()
    turns(8)
    return region_picture(window, region)


def test_escape_ends_an_export(fluid, drop, tmp_path):
    """Frames are written while Blender goes on; what was begun becomes whole, and the scene has its frame again."""
    scene = bpy.context.scene
    scene.frame_end, scene.render.resolution_x, scene.render.resolution_y = 5000, 64, 48
    scene.frame_set(7)

    def written():
        return sorted(path.name for path in tmp_path.iterdir() if path.suffix == ".exr" and not path.name.startswith("."))

    with drop.override():
        assert bpy.ops.meniscus.export_passes("EXEC_DEFAULT", filepath=str(tmp_path / "####.exr")) == {"RUNNING_MODAL"}
    wait_until(lambda: len(written()) >= 3, "three frames")
    act("key", "Escape")
    wait_until(lambda: scene.frame_current == 7, "the end of the export")
    found = written()
    assert len(found) < 5000
    turns(20)
    assert written() == found
    assert all((tmp_path / name).read_bytes()[:4] == b"\x76\x2f\x31\x01" for name in found)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_another_file_ends_an_export(fluid, drop, tmp_path):
    """Without claims left behind, and another one can begin."""
    scene = bpy.context.scene
    scene.frame_end, scene.render.resolution_x, scene.render.resolution_y = 5000, 64, 48
    scene.render.use_overwrite, scene.render.use_placeholder = False, True
    with drop.override():
        assert bpy.ops.meniscus.export_passes("EXEC_DEFAULT", filepath=str(tmp_path / "####.exr")) == {"RUNNING_MODAL"}
        assert not bpy.ops.meniscus.export_passes.poll()
    wait_until(lambda: len(list(tmp_path.glob("0*.exr"))) >= 3, "three frames")
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(5)
    found = sorted(tmp_path.iterdir())
    assert 2 <= len(found) < 5000
    assert all(path.read_bytes()[:4] == b"\x76\x2f\x31\x01" for path in found)
    turns(20)
    assert sorted(tmp_path.iterdir()) == found
    add_points(bpy.context.scene.collection, "Drop", [(0, 0, 0)], radius=1.0)
    assert bpy.ops.meniscus.export_passes.poll()
