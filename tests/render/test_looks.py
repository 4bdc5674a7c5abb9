"""The looks of the viewports, in the shaders, are those of the Combined pass, in numpy."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.look import LOOK_STYLES, look_constants
from meniscus.addon.render.shading import Ranges, SurfacePoints, shaded
from meniscus.gpu_shaders.glsl import Source

COUNT = 4000
RANGES = Ranges((2.0, 7.0), (0.0, 4.0))
SIZES = {"depth": 1, "ball": 1, "thickness": 1, "contrast": 1}
MAIN = """
uniform vec3 light;
uniform vec4 numbers;
uniform vec4 ranges;
uniform vec2 optics;
uniform int style;
out vec4 color;
void main() {
    LookInput seen;
    INPUTS
    LookSettings look;
    look.ambient = numbers.x;
    look.roughness = numbers.y;
    look.light = light;
    look.light_strength = numbers.z;
    look.absorption = numbers.w;
    look.ior = optics.x;
    look.metallic = optics.y;
    look.depth_range = ranges.xy;
    look.speed_range = ranges.zw;
    color = look_color(style, seen, look);
}
"""


def unit(rng, toward=None):
    vectors = rng.normal(size=(COUNT, 3))
    vectors += 0 if toward is None else toward
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


@pytest.fixture
def points():
    """Surfaces that face anywhere, some away from the eye, in all colours, fast and slow, thick and thin."""
    rng = np.random.default_rng(5)
    up = np.array([0.1, 0.8, 0.59], np.float32)
    return SurfacePoints(
        normal=unit(rng, (0, 0, 1)),
        to_eye=unit(rng, (0, 0, 4)),
        up=np.broadcast_to(up / np.linalg.norm(up), (COUNT, 3)).astype(np.float32),
        world_normal=unit(rng),
        base=rng.uniform(0, 1.3, (COUNT, 3)).astype(np.float32),
        velocity=rng.normal(size=(COUNT, 3)).astype(np.float32) * 2,
        depth=rng.uniform(1, 8, COUNT).astype(np.float32),
        ball=rng.integers(0, 1 << 22, COUNT).astype(np.float32),
        thickness=rng.uniform(0, 3, COUNT).astype(np.float32),
        contrast=rng.uniform(0.2, 1.8, COUNT).astype(np.float32),
    )


def colors(points, look):
    """(COUNT, 4): what numpy makes of the points, over nothing."""
    return shaded(points, look, RANGES).over(np.zeros((COUNT, 4), np.float32))


def colors_by_shader(gl, points, look):
    """(count, 4): what lib/shading.glsl makes of the points."""
    names = [item.name for item in fields(points)]
    inputs = "".join(f"in {'float' if name in SIZES else 'vec3'} in_{name};\n" for name in names)
    assigned = " ".join(f"seen.{name} = in_{name};" for name in names)
    text = Source("lib/shading.glsl", look_constants()).text + inputs + MAIN.replace("INPUTS", assigned)
    program = gl.program(vertex_shader=text, varyings=["color"])
    values = {
        "light": look.light_direction,
        "numbers": (look.ambient, look.roughness, look.light_strength, look.absorption),
        "ranges": (*RANGES.depth, *(look.speed_range or RANGES.speed)),
        "optics": (look.ior, look.metallic),
        "style": list(LOOK_STYLES).index(look.style),
    }
    for name, value in values.items():
        program[name].value = value
    buffers = [
        (gl.buffer(np.ascontiguousarray(getattr(points, name))), f"{SIZES.get(name, 3)}f", f"in_{name}") for name in names
    ]
    result = gl.buffer(reserve=COUNT * 16)
    # Without a framebuffer there is no drawing, not even into a buffer.
    gl.simple_framebuffer((1, 1)).use()
    gl.vertex_array(program, buffers).transform(result, gl.POINTS, COUNT)
    return np.frombuffer(result.read(), np.float32).reshape(COUNT, 4)


@pytest.mark.parametrize("style", [name for name, style in LOOK_STYLES.items() if not style.uses_scene])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_shader_and_numpy_agree(opengl, points, style, roughness):
    look = meniscus.Look(
        style=style, roughness=roughness, metallic=0.4, ambient=0.3, light=(1, 2, 3), light_strength=1.4, absorption=0.8
    )
    expected = colors(points, look)
    actual = opengl.run(lambda: colors_by_shader(opengl.gl, points, look))
    assert expected[:, :3].std() > 0.02
    np.testing.assert_allclose(actual, expected, atol=0.5 / 255, rtol=2e-3)


def test_each_ball_has_a_color_of_its_own(points):
    balls = replace(points, ball=np.arange(COUNT, dtype=np.float32))
    shown = colors(balls, meniscus.Look(style="id"))[:, :3]
    assert len(np.unique((shown * 255).round(), axis=0)) > 0.97 * COUNT
    neighbours = np.linalg.norm(np.diff(shown, axis=0), axis=1)
    assert np.median(neighbours) > 0.4


def test_speed_range_of_the_look_counts(points):
    slow = colors(points, meniscus.Look(style="speed", speed_range=(100, 200)))
    np.testing.assert_allclose(slow[:, :3], np.broadcast_to(slow[0, :3], (COUNT, 3)))
    assert slow[0, 2] < 0.2


def test_thick_water_hides_what_is_behind_and_shallow_does_not(points):
    facing = replace(points, normal=points.to_eye, base=np.full((COUNT, 3), 0.2, np.float32))
    look = meniscus.Look(style="water", absorption=2.0)
    shallow = colors(replace(facing, thickness=np.zeros(COUNT, np.float32)), look)
    deep = colors(replace(facing, thickness=np.full(COUNT, 10, np.float32)), look)
    reflected = ((1.33 - 1) / (1.33 + 1)) ** 2
    np.testing.assert_allclose(shallow[:, 3], reflected, atol=1e-4)
    assert deep[:, 3].min() > 0.99
