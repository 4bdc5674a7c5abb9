"""The shared GLSL functions, run on the GPU and compared with double precision."""

from __future__ import annotations

import bernstein
import moderngl
import numpy as np
import pytest

from meniscus.addon.fluid.kernels import KERNELS, POLYNOMIAL_KERNELS
from meniscus.gpu_shaders.glsl import Source
from meniscus.gpu_shaders.kernel_constants import kernel_constants


def run_on_rows(context, library, constants, body, rows):
    """`body` computes `result` from float in_0, in_1, ... of each row; (rows,) float32."""
    names = [f"in_{index}" for index in range(rows.shape[1])]
    inputs = "".join(f"in float {name};\n" for name in names)
    text = Source(library, constants).text + inputs + f"out float result;\nvoid main() {{ {body} }}\n"

    def work():
        gl = context.gl
        program = gl.program(vertex_shader=text, varyings=["result"])
        # The compiler removes inputs that do not matter; their bytes are stepped over.
        layout = " ".join("1f" if name in program else "4x" for name in names)
        used = [name for name in names if name in program]
        array = gl.vertex_array(program, [(gl.buffer(rows.astype("f4")), layout, *used)])
        result = gl.buffer(reserve=4 * len(rows))
        # Without a framebuffer there is no drawing, not even into a buffer.
        gl.simple_framebuffer((1, 1)).use()
        array.transform(result, moderngl.POINTS, len(rows))
        return np.frombuffer(result.read(), np.float32)

    return context.run(work)


@pytest.mark.parametrize("stack", [0, 1, 3])
@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
def test_bezier_clipping_finds_the_first_root(opengl, kernel, stack):
    constants = {**kernel_constants(POLYNOMIAL_KERNELS[kernel]), "BEZIER_STACK": stack, "DIAGNOSTICS": 0}
    degree = constants["KERNEL_DEGREE"]
    polynomials = np.random.default_rng(degree).normal(size=(20000, degree + 1)).astype(np.float32)
    values = ", ".join(f"in_{index}" for index in range(degree + 1))
    body = f"float p[KERNEL_DEGREE + 1] = float[KERNEL_DEGREE + 1]({values}); result = bezier_first_root(p);"
    roots = run_on_rows(opengl, "lib/bezier_clipping.glsl", constants, body, polynomials)
    expected = bernstein.first_root(polynomials.T.astype(np.float64))
    found = roots <= 1
    assert np.count_nonzero(found != np.isfinite(expected)) == 0
    np.testing.assert_allclose(roots[found], expected[found], atol=2e-6)
    assert 0.1 < np.mean(found & (roots > 0)) < 0.9


@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
def test_interval_polynomial_is_the_kernel_along_the_ray(opengl, kernel):
    constants = {**kernel_constants(POLYNOMIAL_KERNELS[kernel]), "BALL_TEXTURE_WIDTH": 1}
    generator = np.random.default_rng(3)
    peak, middle, radius = generator.uniform(0.1, 1, 500), generator.uniform(2, 4, 500), generator.uniform(0.2, 2, 500)
    half = radius * np.sqrt(peak)
    begin = middle + half * generator.uniform(-1, 0, 500)
    end = middle + half * generator.uniform(0, 1, 500)
    rows = np.stack([peak, middle, radius, begin, end], 1).astype(np.float32)
    for index in range(constants["KERNEL_DEGREE"] + 1):
        body = (
            "float p[KERNEL_DEGREE + 1]; for (int i = 0; i <= KERNEL_DEGREE; i++) p[i] = 0.0;"
            f"kernel_add_bernstein(p, Chord(in_0, in_1, in_2), 1.5, in_3, in_4); result = p[{index}];"
        )
        coefficient = run_on_rows(opengl, "lib/kernel.glsl", constants, body, rows)
        at_begin, at_end = (begin - middle) / radius, (end - middle) / radius
        x = np.stack([peak - at_begin**2, peak - at_begin * at_end, peak - at_end**2])
        np.testing.assert_allclose(coefficient, 1.5 * bernstein.compose(POLYNOMIAL_KERNELS[kernel], x)[index], atol=1e-5)


@pytest.mark.parametrize("kernel", KERNELS)
def test_kernel_value_and_derivative(opengl, kernel):
    constants = {**kernel_constants(KERNELS[kernel]), "BALL_TEXTURE_WIDTH": 1}
    x = np.linspace(-0.5, 1, 301)
    for function, expected in (("value", KERNELS[kernel].value(x)), ("derivative", KERNELS[kernel].derivative(x))):
        result = run_on_rows(opengl, "lib/kernel.glsl", constants, f"result = kernel_{function}(in_0);", x[:, None])
        np.testing.assert_allclose(result, expected, rtol=1e-6, atol=2e-6)


def test_depth_textures_keep_every_digit_of_a_float(opengl):
    def work():
        gl = opengl.gl
        texture = opengl.depth_texture((4, 1))
        fragment = "#version 330\nuniform float depth; void main() { gl_FragDepth = depth * (1.0 + gl_FragCoord.x); }"
        vertex = "#version 330\nvoid main() { gl_Position = vec4(4.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0, 1); }"
        program = gl.program(vertex_shader=vertex, fragment_shader=fragment)
        program["depth"] = 2.0**-40
        gl.framebuffer([], texture).use()
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "1"
        gl.vertex_array(program, []).render(moderngl.TRIANGLES, 3)
        return np.frombuffer(texture.read(), np.float32)

    np.testing.assert_array_equal(opengl.run(work), 2.0**-40 * np.arange(1.5, 5, dtype=np.float32))
