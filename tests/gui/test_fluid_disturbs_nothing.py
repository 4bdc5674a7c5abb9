"""Blender's own drawing goes on as if the extension were not there, and memory stays flat."""

import ctypes

import addon_utils
import bpy
import gpu
import numpy as np
import pytest
from blender_fixtures import EXTENSION
from event_loop import turns
from expected import is_steady
from fluid_scenes import add_points
from gl_state import StateReader, changes
from pictures import check_same, screen_picture
from viewports import Viewport, settled

REDRAWS = 1000
MOST_GROWTH = 8.0
"""Megabytes in so many redraws, on software Vulkan beyond those by which Blender grows there by itself, some 100."""

BLOCK = 100


@pytest.fixture
def drop(new_file, fluid):
    """The first viewport, with a fluid beside the cube of a new file."""
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, "Drop", [(2, 0, 0), (2, 0.5, 0.5)], radius=1.0)
    fluid.check_presence("drop", shown)
    return shown


@pytest.mark.skipif(gpu.platform.backend_type_get() != "OPENGL", reason="Blender runs without OpenGL here")
@pytest.mark.parametrize("shading", ["SOLID", "MATERIAL"])
def test_the_state_of_opengl_is_as_it_was(fluid, drop, shading):
    drop.space.shading.type = shading
    reader, before, after = StateReader(), [], []
    addon_utils.disable(EXTENSION)
    handlers = [bpy.types.SpaceView3D.draw_handler_add(reader.read_into, (before,), "WINDOW", "POST_VIEW")]
    addon_utils.enable(EXTENSION)
    handlers += [bpy.types.SpaceView3D.draw_handler_add(reader.read_into, (after,), "WINDOW", "POST_VIEW")]
    drop.redraw(5)
    for handler in handlers:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    fluid.check_presence("drawn_between", drop)
    assert len(before) == len(after) >= 5
    assert [changes(*pair) for pair in zip(before, after, strict=True)] == [{}] * len(after)


def test_the_interface_without_sources_is_as_without_the_extension(new_file):
    bpy.context.preferences.system.viewport_aa = "OFF"
    properties = next(area for area in new_file.screen.areas if area.type == "PROPERTIES")
    properties.spaces.active.context = "WORLD"  # a tab without panels of the extension
    addon_utils.disable(EXTENSION)
    try:
        without = settled_screen()
    finally:
        addon_utils.enable(EXTENSION)
    tag_all()
    check_same("interface", settled_screen(), without, is_steady(without), tolerance=0)


def test_the_interface_around_the_fluid_is_as_without_it(fluid, drop):
    with_fluid = settled_screen()
    bpy.data.objects["Drop"].meniscus.use_fluid = False
    tag_all()
    turns(3)
    without = settled_screen()
    elsewhere = is_steady(without)
    region, window = drop.region, drop.window
    x, y = window.x + region.x, window.y + region.y
    elsewhere[y : y + region.height, x : x + region.width] = False
    check_same("around", with_fluid, without, elsewhere, tolerance=0)


def test_memory_stays_flat(fluid, drop):
    small = shrunk(drop)
    settings = bpy.data.objects["Drop"].meniscus
    orbit(small, 200)
    settings.use_fluid = False
    own = growth_of_orbiting(small, 600) if gpu.platform.backend_type_get() == "VULKAN" else [0.0]
    settings.use_fluid = True
    blocks = growth_of_orbiting(small, REDRAWS)
    growth = REDRAWS / BLOCK * (np.median(blocks) - np.median(own))
    assert growth < MOST_GROWTH, f"{growth:.1f} MB more after {REDRAWS} redraws: {blocks}, without fluid {own}"
    fluid.check_presence("after_many_redraws", small)


def growth_of_orbiting(shown, count):
    """Megabytes that the process grows by in each block of redraws; a few have jumps, up and down."""
    sizes = [resident_megabytes()]
    for _ in range(count // BLOCK):
        orbit(shown, BLOCK)
        sizes.append(resident_megabytes())
    return np.diff(sizes).tolist()


def shrunk(shown):
    """A small part of a viewport; the rest of the window shows what is drawn quickly, and seldom."""
    for direction in ("VERTICAL", "HORIZONTAL"):
        with shown.override():
            bpy.ops.screen.area_split(direction=direction, factor=0.3)
        turns(3)
    kept = shown.area
    for area in shown.window.screen.areas:
        if area != kept and area.height > 100:
            area.type = "CONSOLE"
    turns(3)
    return Viewport()


def orbit(shown, count):
    for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
        shown.view.view_rotation = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
        shown.redraw()


def resident_megabytes():
    ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 2**20


def settled_screen():
    settled(Viewport())
    return screen_picture()


def tag_all():
    for area in bpy.context.window_manager.windows[0].screen.areas:
        area.tag_redraw()
    turns(3)
