"""The OpenGL context: what the driver says, what it can take, which programs it rejects, and what happens when it is reset."""

from __future__ import annotations

import ctypes
import os
import platform
from concurrent.futures import ThreadPoolExecutor

import moderngl
import numpy as np
import pytest
from silence import check_silence

import meniscus
from meniscus.addon.fluid.errors import CancelledError, DeviceError
from meniscus.addon.render import registry
from meniscus.gpu_shaders import context as context_module
from meniscus.gpu_shaders import glsl
from meniscus.gpu_shaders.programs import ProgramSource

BALLS = meniscus.Balls([[-0.3, 0, 0], [0.4, 0.2, 0.1]], 0.9)
CAMERA = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), fov_y=0.6, width=24, height=16)
CONTEXT_LOST = 0x0507
INNOCENT_CONTEXT_RESET = 0x8254
ERROR, DEPRECATED, UNDEFINED, PORTABILITY, PERFORMANCE, OTHER = 0x824C, 0x824D, 0x824E, 0x824F, 0x8250, 0x8251
HIGH, MEDIUM, LOW, NOTIFICATION = 0x9146, 0x9147, 0x9148, 0x826B


def render(method="depth_peeling"):
    return meniscus.render(BALLS, CAMERA, meniscus.Field(), method=method)


@pytest.fixture
def debug_output(opengl):
    """A driver that has debug output; macOS has none, but CI's has."""
    if opengl.version < 430 and "GL_KHR_debug" not in opengl.gl.extensions:
        give_up = pytest.fail if os.environ.get("CI") else pytest.skip
        give_up("this OpenGL has no debug output")


def test_a_wrong_call_is_an_error_in_the_drivers_words_and_breaks_the_silence(opengl, debug_output):
    def draw_nonsense():
        opengl.function("glDrawArrays", ctypes.c_uint, ctypes.c_int, ctypes.c_int)(0x1234, 0, 3)

    with pytest.raises(DeviceError, match=r"reports GL_INVALID_ENUM \(error: .*\); render a smaller image or use the CPU"):
        opengl.run(draw_nonsense)
    with pytest.raises(AssertionError, match="The driver complains: error: "):
        check_silence(opengl)
    check_silence(opengl)
    # The error is over with the work that made it.
    opengl.run(lambda: None)


@pytest.mark.parametrize(
    ("kind", "severity", "is_told"),
    [
        (ERROR, HIGH, True),
        (DEPRECATED, LOW, True),
        (UNDEFINED, MEDIUM, True),
        (PORTABILITY, LOW, True),
        (OTHER, HIGH, True),
        (OTHER, MEDIUM, True),
        (OTHER, LOW, False),
        (OTHER, NOTIFICATION, False),
        (UNDEFINED, NOTIFICATION, False),
        (PERFORMANCE, MEDIUM, False),
        (PERFORMANCE, NOTIFICATION, False),
    ],
)
def test_of_the_drivers_messages_those_that_matter_are_kept(opengl, debug_output, kind, severity, is_told):
    from_application = 0x824A

    def insert():
        arguments = (*[ctypes.c_uint] * 4, ctypes.c_int, ctypes.c_char_p)
        opengl.function("glDebugMessageInsert", *arguments)(from_application, kind, 1, severity, -1, b"listen")

    for _ in range(2):
        opengl.run(insert)
    messages = opengl.debug_messages()
    assert [message.partition(": ")[2] for message in messages] == ["listen", "listen"] * is_told


def test_messages_that_nobody_takes_do_not_pile_up(opengl):
    opengl._messages.extend(map(str, range(1000)))
    assert opengl.debug_messages()[-1] == "999"
    assert opengl.debug_messages() == []
    opengl._messages.extend(map(str, range(1000)))
    assert len(opengl.debug_messages()) < 1000


def test_limits_are_those_of_the_driver_and_at_least_those_of_opengl_3_3(opengl):
    integer = ctypes.c_int()

    def ask():
        opengl.function("glGetIntegerv", ctypes.c_uint, ctypes.c_void_p)(0x0D33, ctypes.addressof(integer))

    opengl.run(ask)
    assert opengl.limits.texture_size == integer.value >= 1024
    assert opengl.limits.draw_buffers >= 8


@pytest.mark.skipif(platform.system() != "Linux", reason="elsewhere the window system gives the context")
def test_the_newest_version_is_asked_for_first_and_3_3_after_it(monkeypatch):
    asked = []

    def give(**arguments):
        asked.append(arguments["glversion"])
        if asked[-1] > 330:
            raise Exception("eglCreateContext failed (0x3009)")  # as glcontext does
        return "a context"

    monkeypatch.setattr(context_module.glcontext, "get_backend_by_name", lambda name: give)
    assert context_module._standalone_glcontext() == "a context"
    assert asked == [430, 330]


def test_too_few_render_targets_are_one_sentence(opengl, pretend_limits):
    opengl.require(330, draw_buffers=8)
    pretend_limits(draw_buffers=4)
    opengl.require(330, draw_buffers=4)
    with pytest.raises(DeviceError, match=r"^8 render targets at once are needed but .+ offers 4; choose another method$"):
        opengl.require(330, draw_buffers=8)
    with pytest.raises(DeviceError, match=r"^OpenGL 9\.9 is needed but .+ offers .+; choose another method$"):
        opengl.require(990)


VERTEX = "void main() {\n    gl_Position = vec4(1.0);\n}\n"
FRAGMENT = "out vec4 color;\nvoid main() {\n    color = vec4(1.0);\n}\n"
GEOMETRY = "layout(points) in;\nlayout(points, max_vertices = 1) out;\nvoid main() {\n    EmitVertex();\n}\n"


@pytest.fixture
def compile_shaders(opengl, tmp_path, monkeypatch):
    """Compiles a program of the texts of its stages."""
    monkeypatch.setattr(glsl, "ROOT", tmp_path)
    monkeypatch.setattr(opengl, "_programs", {})

    def compile_program(varyings=(), **stages):
        for stage, text in stages.items():
            (tmp_path / f"shader.{stage}").write_text(text)
        paths = {stage: f"shader.{stage}" for stage in stages}
        return opengl.run(lambda: opengl.program(ProgramSource("planted", **paths, varyings=varyings)))

    yield compile_program
    # The driver tells of errors in shaders in both ways.
    opengl.debug_messages()


@pytest.mark.parametrize("stage", ["vertex", "geometry", "fragment"])
def test_a_shader_that_does_not_compile_is_reported_with_file_and_line(compile_shaders, stage):
    stages = {"vertex": VERTEX, "geometry": GEOMETRY, "fragment": FRAGMENT}
    stages[stage] = stages[stage].replace("main() {\n", "main() {\n    nothing;\n")
    line = stages[stage].splitlines().index("    nothing;") + 1
    with pytest.raises(DeviceError, match=rf"^The graphics driver rejects .*: .*shader\.{stage}[:(]{line}\D") as caught:
        compile_shaders(**stages)
    assert "\n" not in str(caught.value)


def test_programs_with_all_stages_and_with_captured_outputs_compile(compile_shaders):
    assert compile_shaders(vertex=VERTEX, geometry=GEOMETRY, fragment=FRAGMENT).geometry_input == moderngl.POINTS
    captured = VERTEX.replace("void", "out float v_x;\nvoid").replace("main() {", "main() {\n    v_x = 1.0;")
    assert compile_shaders(vertex=captured, varyings=("v_x",)).is_transform


WRITES_V_X = GEOMETRY.replace("void", "out vec2 v_x;\nvoid").replace("Emit", "v_x = vec2(1.0);\n    Emit")
READS_V_X = FRAGMENT.replace("out", "in vec4 v_x;\nout").replace("1.0", "v_x.x")


@pytest.mark.parametrize(
    ("stages", "varyings"),
    [
        ({"vertex": f"out vec2 v_x;\n{VERTEX}", "fragment": READS_V_X}, ()),
        ({"vertex": VERTEX, "geometry": WRITES_V_X, "fragment": READS_V_X}, ()),
        ({"vertex": VERTEX}, ("v_x",)),
    ],
)
def test_stages_that_do_not_fit_together_are_reported_with_their_files(opengl, compile_shaders, stages, varyings):
    if "fragment" in stages and "NVIDIA" in opengl.gl.info["GL_RENDERER"]:
        pytest.skip("NVIDIA's driver links stages whose types differ")
    files = ", ".join(f"shader.{stage}" for stage in stages)
    with pytest.raises(DeviceError, match=rf"^The graphics driver rejects {files}; choose another method.*\bv_x\b"):
        compile_shaders(varyings, **stages)


def lose_by_error(context, monkeypatch):
    monkeypatch.setattr(context._driver, "_get_error", lambda: CONTEXT_LOST)


def lose_by_reset_status(context, monkeypatch):
    monkeypatch.setattr(context._driver, "_get_reset_status", lambda: INNOCENT_CONTEXT_RESET)


@pytest.mark.parametrize("name", ["depth_peeling", "fitted_bvh", "tile_lists"])
@pytest.mark.parametrize("lose", [lose_by_error, lose_by_reset_status])
def test_a_lost_context_fails_the_render_and_the_next_one_has_a_new_context(another_context, monkeypatch, lose, name):
    expected = render(name)
    info, method = registry.create_method(name)
    assert registry.create_method(name) == (info, method)
    lose(another_context, monkeypatch)
    sentence = "^The graphics driver was reset and what was being rendered is lost; render again, .*$"
    with pytest.raises(DeviceError, match=sentence):
        render(name)
    # A render that holds the lost context fails like that whenever it goes on.
    with pytest.raises(DeviceError, match=sentence):
        another_context.run(lambda: pytest.fail("work in a lost context"))
    image = render(name)
    assert another_context.is_lost
    assert context_module.shared_context() is not another_context
    assert registry.create_method(name)[1] is not method
    np.testing.assert_array_equal(image["depth"], expected["depth"])
    check_silence(context_module.shared_context())


@pytest.mark.parametrize("failure", [moderngl.Error("cannot create texture"), CancelledError("cancelled"), ValueError("size")])
def test_what_goes_wrong_in_a_lost_context_is_its_loss(another_context, monkeypatch, failure):
    def work():
        lose_by_reset_status(another_context, monkeypatch)
        raise failure

    with pytest.raises(DeviceError, match="driver was reset"):
        another_context.run(work)


def test_what_goes_wrong_in_a_sound_context_is_passed_on(opengl):
    def fail(error):
        raise error

    with pytest.raises(CancelledError, match="enough"):
        opengl.run(lambda: fail(CancelledError("enough")))
    with pytest.raises(DeviceError, match=r"driver failed \(no memory\)"):
        opengl.run(lambda: fail(moderngl.Error("no memory")))


def test_a_driver_that_does_not_come_back_at_once_is_asked_again(another_context, monkeypatch):
    def refuse():
        raise Exception("still resetting")

    another_context.is_lost = True
    with monkeypatch.context() as patches:
        patches.setattr(context_module, "_standalone_glcontext", refuse)
        for _ in range(2):
            with pytest.raises(DeviceError, match="still resetting"):
                context_module.shared_context()
    assert render().hit.any()


def test_threads_that_ask_at_once_get_one_context(another_context):
    another_context.is_lost = True
    with ThreadPoolExecutor(4) as threads:
        contexts = list(threads.map(lambda _: context_module.shared_context(), range(8)))
    assert len(set(contexts)) == 1
    assert contexts[0] is not another_context
