"""Two OpenGL contexts that share their objects: the surface goes from one to the other without passing through memory."""

from __future__ import annotations

import ctypes
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import glcontext
import moderngl
import numpy as np
import pytest
from silence import check_silence

import meniscus
from meniscus.addon.fluid.camera import Region
from meniscus.addon.fluid.errors import DeviceError
from meniscus.addon.fluid.image import ImageBuffers
from meniscus.addon.render.device_image import DeviceImage
from meniscus.addon.render.renderer import render_to_show
from meniscus.gpu_shaders import context as context_module
from meniscus.gpu_shaders.methods.depth_peeling import method as depth_peeling
from meniscus.gpu_shaders.sharing import EglContext, sharing_context

FRAMEBUFFER_BINDINGS = 0x8CA6, 0x8CAA
TEXTURE_BINDING_2D, ACTIVE_TEXTURE, CURRENT_PROGRAM, VERTEX_ARRAY_BINDING = 0x8069, 0x84E0, 0x8B8D, 0x85B5
VIEWPORT = 0x0BA2
MOST_NAMES = 4000


class Program:
    """A program around Meniscus with an OpenGL context of its own, on a thread of its own, as Blender has one."""

    def __init__(self):
        self._thread = ThreadPoolExecutor(1)
        self.run(self._open)

    def run(self, work, *arguments):
        return self._thread.submit(work, *arguments).result()

    def _open(self):
        backend = glcontext.get_backend_by_name("egl")
        self._context = backend(mode="standalone", libgl="libGL.so.1", libegl="libEGL.so.1", glversion=330)
        self.gl = moderngl.create_context(require=330, standalone=True, context=self._context)
        self._egl = ctypes.CDLL("libEGL.so.1")
        self._egl.eglGetCurrentContext.restype = ctypes.c_void_p

    def close(self):
        self.run(self._close)

    def _close(self):
        with self._context:
            self._context.release()

    def current(self):
        """Which context is current."""
        return self._egl.eglGetCurrentContext()

    def function(self, name, *arguments, result=None):
        return ctypes.CFUNCTYPE(result, *arguments)(self._context.load(name))

    def state(self):
        """What a program would notice if it were changed."""
        get = self.function("glGetIntegerv", ctypes.c_uint, ctypes.c_void_p)
        values = {}
        for name in (
            *FRAMEBUFFER_BINDINGS,
            TEXTURE_BINDING_2D,
            ACTIVE_TEXTURE,
            CURRENT_PROGRAM,
            VERTEX_ARRAY_BINDING,
            VIEWPORT,
        ):
            numbers = (ctypes.c_int * 4)()
            get(name, numbers)
            values[name] = tuple(numbers)
        return self.current(), values

    def objects(self):
        """How many objects of each kind there are that contexts share."""
        return {kind: self.run(self._count, f"glIs{kind}") for kind in ("Texture", "Buffer", "Program", "Shader")}

    def _count(self, name):
        exists = self.function(name, ctypes.c_uint, result=ctypes.c_ubyte)
        return sum(exists(number) for number in range(1, MOST_NAMES))

    def copy(self, surface):
        """The passes of a surface, copied into textures of this context and read there."""
        return self.run(self._copy, surface, surface.size)

    def _copy(self, surface, size):
        textures = [self.gl.texture(size, 1 if name == "depth" else 4, dtype="f4") for name in surface.passes]
        framebuffer = self.gl.framebuffer(textures)
        framebuffer.use()
        before = self.state()
        try:
            surface.copy_to_attachments()
            assert self.state() == before
            width, height = size
            pixels = [np.frombuffer(texture.read(), np.float32).reshape(height, width, -1) for texture in textures]
        finally:
            for item in (framebuffer, *textures):
                item.release()
        return {
            name: image[..., 0] if name == "depth" else image[..., :3]
            for name, image in zip(surface.passes, pixels, strict=True)
        }


@pytest.fixture
def program():
    program = Program()
    yield program
    program.close()


@pytest.fixture
def sharing(program, monkeypatch):
    """The process's context shares with that of the program."""
    monkeypatch.setattr(context_module, "_shared", None)
    before = program.run(program.state)
    program.run(context_module.share_with_current_context)
    assert program.run(program.state) == before
    yield context_module.shared_context()
    check_silence(context_module.shared_context())
    context_module.close_context()


def scene(colors=True, count=40, seed=3):
    random = np.random.default_rng(seed)
    palette = random.uniform(0, 1, (count, 3)) if colors else None
    return meniscus.Balls(random.uniform(-1, 1, (count, 3)), 0.5, colors=palette)


CAMERA = meniscus.Camera.perspective((0, -5, 1), (0, 0, 0), fov_y=0.6, width=90, height=70)
FIELD = meniscus.Field()


def show(balls, passes=("depth", "normal"), camera=CAMERA, **arguments):
    return render_to_show(balls, camera, FIELD, method="depth_peeling", passes=passes, **arguments)


@pytest.mark.parametrize("passes", [("depth", "normal"), ("depth", "normal", "color")])
@pytest.mark.parametrize("pixels_a_part", [2**20, 1000])
def test_the_surface_on_the_device_is_the_one_that_is_read_back(program, sharing, monkeypatch, passes, pixels_a_part):
    monkeypatch.setattr(depth_peeling, "_PIXELS_A_PART", pixels_a_part)
    image = show(scene(), passes)
    assert isinstance(image, DeviceImage)
    assert image.camera is CAMERA
    assert image.info.method == "depth_peeling"
    assert image.info.counts["peels"] > 0
    copied = program.copy(image.surface)
    expected = meniscus.render(scene(), CAMERA, FIELD, method="depth_peeling", passes=passes)
    assert 0.2 < expected.hit.mean() < 0.9
    assert set(copied) == set(passes)
    for name in passes:
        np.testing.assert_array_equal(copied[name], expected[name], err_msg=name)


def test_a_view_without_fluid_is_background_on_the_device(program, sharing):
    away = meniscus.Camera.perspective((0, -5, 1), (0, -9, 1), fov_y=0.6, width=30, height=20)
    copied = program.copy(show(scene(), camera=away).surface)
    assert np.all(copied["depth"] == 1e10)
    assert np.all(copied["normal"] == 0)


def test_a_surface_can_be_copied_while_the_next_one_is_drawn(program, sharing):
    first = show(scene(seed=3))
    expected = program.copy(first.surface)
    show(scene(seed=4))
    again = program.copy(first.surface)
    np.testing.assert_array_equal(again["depth"], expected["depth"])


def test_what_the_device_cannot_keep_comes_through_memory(sharing):
    assert isinstance(show(scene(), passes=("depth", "position")), ImageBuffers)
    assert isinstance(show(scene(colors=False), passes=("depth", "color")), ImageBuffers)
    assert isinstance(show(scene(), camera=replace(CAMERA, region=Region(0, 0, 20, 20))), ImageBuffers)


def test_a_context_that_shares_with_none_reads_back():
    assert isinstance(show(scene()), ImageBuffers)


def test_textures_of_another_size_are_refused_in_one_sentence(program, sharing):
    surface = show(scene()).surface
    with pytest.raises(DeviceError, match=r"^The graphics driver does not copy textures from one context to another$"):
        program.run(program._copy, surface, (50, 40))
    # The program finds no error that is not its own.
    assert program.run(program.function("glGetError", result=ctypes.c_uint)) == 0


def wait_until_idle(context):
    """Wait for what nobody waits for; unlike any work it frees nothing by itself."""
    context._thread.submit(lambda: None).result()


def test_nothing_piles_up_and_nothing_stays_behind(program, monkeypatch):
    monkeypatch.setattr(context_module, "_shared", None)
    before = program.objects()
    for _ in range(2):
        program.run(context_module.share_with_current_context)
        counts = []
        for number in range(6):
            surface = show(scene(seed=number), ("depth", "normal", "color")).surface
            program.copy(surface)
            surface.release()
            wait_until_idle(context_module.shared_context())
            counts.append(program.objects())
        assert counts[1] == counts[-1]
        assert counts[-1]["Texture"] > before["Texture"]
        check_silence(context_module.shared_context())
        context_module.close_context()
        assert program.objects() == before


def test_a_surface_that_is_released_is_given_back_without_further_work(program, sharing):
    show(scene())
    sharing.run(lambda: None)
    before = program.objects()
    image = show(scene())
    assert program.objects() != before
    image.surface.release()
    wait_until_idle(sharing)
    assert program.objects() == before


def test_a_surface_that_nobody_holds_is_given_back(program, sharing):
    show(scene())
    sharing.run(lambda: None)
    before = program.objects()
    kept = [show(scene()) for _ in range(3)]
    assert program.objects()["Texture"] == before["Texture"] + 6
    kept.clear()
    sharing.run(lambda: None)
    assert program.objects() == before


def test_sharing_again_changes_nothing(program, sharing):
    program.run(context_module.share_with_current_context)
    assert context_module.shared_context() is sharing
    assert sharing.shares


def test_renders_that_were_asked_for_before_are_finished(program, monkeypatch):
    monkeypatch.setattr(context_module, "_shared", None)
    alone = context_module.shared_context()
    assert not alone.shares
    with ThreadPoolExecutor(1) as threads:
        # The thread of the context is busy until the program goes on.
        begun = threads.submit(alone.run, lambda: program.run(context_module.share_with_current_context))
        assert begun.result() is None
    image = meniscus.render(scene(), CAMERA, FIELD, method="depth_peeling")
    assert image.hit.any()
    assert context_module.shared_context().shares
    context_module.close_context()


def test_a_lost_context_is_replaced_by_one_of_its_own_until_it_shares_again(program, sharing):
    sharing.is_lost = True
    assert not context_module.shared_context().shares
    assert isinstance(show(scene()), ImageBuffers)
    program.run(context_module.share_with_current_context)
    assert isinstance(show(scene()), DeviceImage)


def test_without_a_current_context_there_is_nothing_to_share_with(monkeypatch):
    present = context_module.shared_context()
    with (
        ThreadPoolExecutor(1) as thread,
        pytest.raises(DeviceError, match=r"^There is no OpenGL context here with which textures can be shared$"),
    ):
        thread.submit(context_module.share_with_current_context).result()
    assert context_module.shared_context() is present


def test_a_driver_that_refuses_is_one_sentence_and_leaves_the_program_alone(program, monkeypatch):
    monkeypatch.setattr(context_module, "_shared", None)
    before = program.run(program.state)

    def refuse(_):
        raise DeviceError("no second thread")

    monkeypatch.setattr(EglContext, "__enter__", refuse)
    with pytest.raises(DeviceError, match="no second thread"):
        program.run(context_module.share_with_current_context)
    assert program.run(program.state) == before
    assert isinstance(program.run(sharing_context), EglContext)
    assert not context_module.shared_context().shares
    context_module.close_context()
