"""The methods' OpenGL context shares its textures with Blender's: the picture is the same, and Blender notices nothing."""

import ctypes
import importlib
from dataclasses import replace

import bpy
import gpu
import numpy as np
import pytest
from gpu_extras.batch import batch_for_shader
from viewports import Viewport

TEXTURE_BINDING_2D = 0x8069
# Framebuffers, viewport, scissor, program, vertex array, buffers, units, depth, culling, blending, stencil, polygons, pixels.
INTEGERS = (0x8CA6, 0x8CAA, 0x0BA2, 0x0C10, 0x8B8D, 0x85B5, 0x8894, 0x84E0, TEXTURE_BINDING_2D, 0x0B74, 0x0B45, 0x0B46, 0x80C9)
INTEGERS += (0x80C8, 0x0B92, 0x0B97, 0x0B40, 0x8E4F, 0x0CF5, 0x0D05, 0x88EF, 0x88ED, 0x0C23, 0x0B72)
# Depth, scissor, culling, sRGB, stencil, blending.
FLAGS = 0x0B71, 0x0C11, 0x0B44, 0x8DB9, 0x0B90, 0x0BE2
MOST_NAMES = 4000

pytestmark = pytest.mark.skipif(gpu.platform.backend_type_get() != "OPENGL", reason="Blender runs without OpenGL here")

VERTEX = "void main() { gl_Position = vec4(corner, 0.0, 1.0); }"
FRAGMENT = """
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy - origin);
    float depth = texelFetch(depth_tx, pixel, 0).x;
    if (depth >= 1e10)
        discard;
    out_color = vec4(0.5 + 0.5 * texelFetch(normal_tx, pixel, 0).rgb, 1.0);
    gl_FragDepth = 0.5 + 0.5 * (projection_row.y - projection_row.x * depth) / depth;
}
"""


class OpenGL:
    """Blender's OpenGL, in a draw handler."""

    def __init__(self):
        self._library = ctypes.CDLL("libGL.so.1")
        self._library.glXGetCurrentContext.restype = ctypes.c_void_p
        self._library.glXGetCurrentDrawable.restype = ctypes.c_ulong
        self._library.glIsEnabled.restype = ctypes.c_ubyte
        self._library.glIsTexture.restype = ctypes.c_ubyte

    def state(self):
        """What Blender would notice; which texture is bound changes whenever its own module makes one."""
        state = {"current": (self._library.glXGetCurrentContext(), self._library.glXGetCurrentDrawable())}
        for name in INTEGERS:
            numbers = (ctypes.c_int * 4)()
            self._library.glGetIntegerv(name, numbers)
            state[name] = tuple(numbers)
        state.update({name: self._library.glIsEnabled(name) for name in FLAGS})
        del state[TEXTURE_BINDING_2D]
        return state

    def textures(self):
        """How many textures there are."""
        return sum(self._library.glIsTexture(name) for name in range(1, MOST_NAMES))


class Drawing:
    """Draws the fluid anew at each redraw, with the normals as colours."""

    def __init__(self, package, balls):
        self._sharing = importlib.import_module(f"{package}.addon.blender.texture_sharing")
        self._view_camera = importlib.import_module(f"{package}.addon.blender.view_camera").view_camera
        self._render = importlib.import_module(f"{package}.addon.render.renderer").render_to_show
        self._context = importlib.import_module(f"{package}.gpu_shaders.context")
        self._field = importlib.import_module(f"{package}.addon.fluid.field").Field()
        self._balls = balls
        self.method = "tile_lists"
        self._shader = None
        self._opengl = OpenGL()
        self.is_drawing = self.is_sharing = True
        self.kinds, self.textures, self.failures = [], [], []

    def __call__(self):
        try:
            if self.is_drawing:
                self._draw()
        except Exception as failure:  # noqa: BLE001 - Blender would only print it
            self.failures.append(failure)

    def _draw(self):
        before = self._opengl.state()
        if self.is_sharing:
            self._sharing.SHARING.begin()
        _, _, width, height = gpu.state.viewport_get()
        matrices = gpu.matrix.get_model_view_matrix(), gpu.matrix.get_projection_matrix()
        camera = replace(self._view_camera(*matrices, width, height, self._balls.bounds).camera, region=None)
        image = self._render(self._balls, camera, self._field, method=self.method)
        textures = self._sharing.textures_of(image)
        assert self._opengl.state() == before
        self.kinds.append(type(image).__name__)
        self._present(textures, matrices[1])
        # What was given back is deleted on the context's own thread.
        self._context.shared_context().run(lambda: None)
        self.textures.append(self._opengl.textures())

    def _present(self, textures, projection):
        self._shader = self._shader or _shader()
        batch = batch_for_shader(self._shader, "TRI_STRIP", {"corner": [(-1, -1), (1, -1), (-1, 1), (1, 1)]})
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        self._shader.bind()
        for name in ("depth", "normal"):
            self._shader.uniform_sampler(f"{name}_tx", textures[name])
        self._shader.uniform_float("projection_row", (projection[2][2], projection[2][3]))
        self._shader.uniform_float("origin", gpu.state.viewport_get()[:2])
        batch.draw(self._shader)
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)


def _shader():
    info = gpu.types.GPUShaderCreateInfo()
    info.vertex_in(0, "VEC2", "corner")
    info.fragment_out(0, "VEC4", "out_color")
    for unit, name in enumerate(("depth", "normal")):
        info.sampler(unit, "FLOAT_2D", f"{name}_tx")
    info.push_constant("VEC2", "projection_row")
    info.push_constant("VEC2", "origin")
    if hasattr(info, "depth_write"):
        info.depth_write("ANY")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


@pytest.fixture
def drawing(meniscus, monkeypatch):
    """Draws a ring of balls that goes through the cube of a new file; software counts as a card."""
    package = meniscus.__name__
    sharing = importlib.import_module(f"{package}.addon.blender.texture_sharing")
    monkeypatch.setattr(sharing, "_is_worthwhile", lambda: True)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    # Antialiasing refines the viewport from redraw to redraw.
    bpy.context.preferences.system.viewport_aa = "OFF"
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            space = area.spaces.active
            space.overlay.show_overlays = space.show_gizmo = space.shading.show_object_outline = False
    bpy.ops.object.select_all(action="DESELECT")
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    drawing = Drawing(package, meniscus.Balls(1.6 * np.stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(angle)], -1), 0.8))
    handler = bpy.types.SpaceView3D.draw_handler_add(drawing, (), "WINDOW", "POST_VIEW")
    yield drawing
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    sharing.SHARING.end()
    # What Blender's module made must not outlive its context, not even in a traceback.
    drawing._shader = None
    redraw()
    assert drawing.failures == []


def resident_megabytes():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 2**20


def pictures(drawing, fluid):
    """With the cube and without."""
    drawing.is_drawing = fluid
    seen = []
    for is_shown in (True, False):
        bpy.data.objects["Cube"].hide_set(not is_shown)
        redraw()
        seen.append(Viewport().picture())
    return seen


def redraw(times=2):
    """Draw the viewport so often."""
    Viewport().redraw(times)


def test_the_picture_is_the_one_that_is_read_back_and_meshes_hide_and_are_hidden(drawing):
    cube, nothing = pictures(drawing, fluid=False)
    assert drawing.kinds == []
    both, fluid = pictures(drawing, fluid=True)
    assert set(drawing.kinds) == {"DeviceImage"}
    drawing._sharing.SHARING.end()
    drawing.is_sharing = False
    drawing.kinds.clear()
    for picture, expected in zip(pictures(drawing, fluid=True), (both, fluid), strict=True):
        np.testing.assert_array_equal(picture, expected)
    assert set(drawing.kinds) == {"ImageBuffers"}
    overlap = np.any(fluid != nothing, -1) & np.any(cube != nothing, -1)
    assert overlap.sum() > 1000
    shows_fluid, shows_cube = (np.abs(both.astype(int) - picture).max(-1) <= 2 for picture in (fluid, cube))
    assert np.all(shows_fluid | shows_cube)
    assert shows_fluid[overlap].sum() > 500
    assert shows_cube[overlap].sum() > 500


def test_sharing_leaves_nothing_behind(drawing):
    redraw(10)
    assert set(drawing.kinds) == {"DeviceImage"}
    resident = [resident_megabytes()]
    for _ in range(4):
        redraw(50)
        resident.append(resident_megabytes())
    assert len(drawing.textures) >= 200
    # Blender keeps some textures for later use.
    assert max(drawing.textures[-100:]) <= max(drawing.textures[5:100])
    # What is made once and kept, by the driver or by malloc, grows in some stretch; what is lost grows in each.
    assert min(np.diff(resident)) < 1


def test_sharing_can_end_and_begin_again(drawing):
    drawing.method = "depth_peeling"  # which keeps textures of its own
    redraw(3)
    shared = drawing.textures[-1]
    for _ in range(5):
        drawing._sharing.SHARING.end()
        assert drawing._sharing.SHARING.problem
        redraw(3)
        assert not drawing._sharing.SHARING.problem
        assert drawing.textures[-1] == shared
    drawing._sharing.SHARING.end()
    drawing.is_sharing = False
    redraw()
    assert drawing.textures[-1] < shared


def test_other_windows_and_other_files_share_too(drawing):
    redraw()
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.wm.window_new()
    for index in range(2):
        Viewport(index).redraw(2)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[-1]):
        bpy.ops.wm.window_close()
    redraw()
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    redraw()
    assert set(drawing.kinds) == {"DeviceImage"}


def test_where_copying_fails_the_picture_comes_through_memory(meniscus, drawing, monkeypatch):
    package = meniscus.__name__
    textures = importlib.import_module(f"{package}.gpu_shaders.surface_textures")
    errors = importlib.import_module(f"{package}.addon.fluid.errors")
    redraw()
    expected = Viewport().picture()

    def fail(_):
        raise errors.DeviceError("no such copy")

    monkeypatch.setattr(textures.SurfaceTextures, "copy_to_attachments", fail)
    drawing.kinds.clear()
    redraw()
    np.testing.assert_array_equal(Viewport().picture(), expected)
    assert drawing.kinds == ["DeviceImage", *["ImageBuffers"] * (len(drawing.kinds) - 1)]
    assert drawing._sharing.SHARING.problem.endswith("no such copy")
