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
from gpu_extras.batch import batch_for_shader
from pictures import check_same, screen_picture
from viewports import Viewport, settled, shrunk

REDRAWS = 1000
MOST_GROWTH = 8.0
"""Megabytes in so many redraws, on Vulkan beyond those by which Blender grows there by itself: for each of anyone's draws."""

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
    own = growth_without_fluid(small) if gpu.platform.backend_type_get() == "VULKAN" else [0.0]
    settings.use_fluid = True
    orbit(small, BLOCK)  # the fluid's images are made anew, and Blender's pools fill
    blocks = growth_of_orbiting(small, REDRAWS)
    growth = REDRAWS * (np.median(blocks) - np.median(own))
    assert growth < MOST_GROWTH, f"{growth:.1f} MB more after {REDRAWS} redraws: {blocks}, without fluid {own}"
    fluid.check_presence("after_many_redraws", small)


def growth_without_fluid(shown):
    """As `growth_of_orbiting`, with a handler that does on the graphics processor what the fluid needs, and nothing else."""
    quads = Quads()
    handler = bpy.types.SpaceView3D.draw_handler_add(quads.draw, (), "WINDOW", "POST_VIEW")
    try:
        return growth_of_orbiting(shown, 600)
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


class Quads:
    """Draws new textures into a framebuffer, and that to the screen, each with numbers of its own."""

    def __init__(self):
        info = gpu.types.GPUShaderCreateInfo()
        info.typedef_source("struct Numbers { vec4 color; };")
        info.uniform_buf(0, "Numbers", "numbers")
        for slot, name in enumerate(("first_tx", "second_tx")):
            info.sampler(slot, "FLOAT_2D", name)
        info.vertex_in(0, "VEC2", "corner")
        info.fragment_out(0, "VEC4", "out_color")
        info.vertex_source("void main() { gl_Position = vec4(0.1 * corner, 0.0, 1.0); }")
        texels = " + ".join(f"texelFetch({name}, ivec2(0), 0)" for name in ("first_tx", "second_tx"))
        info.fragment_source(f"void main() {{ out_color = numbers.color * ({texels}); }}")
        self._shader = gpu.shader.create_from_info(info)
        self._batch = batch_for_shader(self._shader, "TRI_STRIP", {"corner": [(-1, -1), (1, -1), (-1, 1), (1, 1)]})
        self._target = gpu.types.GPUTexture((64, 64), format="RGBA16F")
        self._framebuffer = gpu.types.GPUFrameBuffer(color_slots=[self._target])
        self._numbers = [gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", 4, [0.5] * 4)) for _ in range(2)]

    def draw(self):
        new = [gpu.types.GPUTexture((64, 64), format="R32F", data=gpu.types.Buffer("FLOAT", 4096)) for _ in range(2)]
        with self._framebuffer.bind():
            self._draw_quad(self._numbers[0], *new)
        self._draw_quad(self._numbers[1], new[0], self._target)

    def _draw_quad(self, numbers, first, second):
        numbers.update(gpu.types.Buffer("FLOAT", 4, [0.5] * 4))
        self._shader.bind()
        self._shader.uniform_sampler("first_tx", first)
        self._shader.uniform_sampler("second_tx", second)
        self._shader.uniform_block("numbers", numbers)
        self._batch.draw(self._shader)


def growth_of_orbiting(shown, count):
    """Megabytes a redraw that the process grows by, in each of several blocks of them; a few have jumps, up and down.

    Redraws are counted: new images of the fluid ask for some more.
    """
    drawn = []
    handler = bpy.types.SpaceView3D.draw_handler_add(drawn.append, (None,), "WINDOW", "POST_PIXEL")
    sizes, counts = [resident_megabytes()], [0]
    for _ in range(count // BLOCK):
        orbit(shown, BLOCK)
        sizes.append(resident_megabytes())
        counts.append(len(drawn))
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    return (np.diff(sizes) / np.diff(counts)).tolist()


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
