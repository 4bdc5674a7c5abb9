"""`make lint` gives the shaders to the reference compiler; these are the ones that the driver gets."""

from __future__ import annotations

import pytest
import shader_lint

import meniscus
from meniscus.addon.fluid.displays import METABALLS
from meniscus.addon.fluid.kernels import KERNELS, POLYNOMIAL_KERNELS
from meniscus.addon.render.registry import method_infos

GPU_METHODS = [info for info in method_infos() if info.backend == "gpu"]


@pytest.fixture(scope="module")
def checked_programs():
    """What lint checks: for each program the texts of its shaders by stage, as moderngl passes them on."""
    programs = shader_lint.method_programs()
    return [{stage: source.text.strip() for stage, source in program.sources().items()} for program in programs]


@pytest.fixture
def compiled_programs(another_context, monkeypatch):
    """Collects the texts by stage of all programs that a fresh context compiles."""
    compiled = []
    gl = another_context.gl
    compile_program, compile_compute = gl.program, gl.compute_shader

    def record(**arguments):
        texts = {name.removesuffix("_shader"): text for name, text in arguments.items() if name.endswith("_shader")}
        compiled.append({stage: text.strip() for stage, text in texts.items() if text})
        return compile_program(**arguments)

    def record_compute(source):
        compiled.append({"compute": source.strip()})
        return compile_compute(source)

    monkeypatch.setattr(gl, "program", record)
    monkeypatch.setattr(gl, "compute_shader", record_compute)
    return compiled


@pytest.mark.parametrize("method", GPU_METHODS, ids=lambda info: info.name)
def test_lint_checks_what_the_driver_gets(method, compiled_programs, checked_programs):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=8, height=8)
    kernels = KERNELS if method.any_kernel and METABALLS in method.displays else POLYNOMIAL_KERNELS
    for kernel in kernels:
        for colors in (None, (1, 0, 0)):
            for display in method.displays:
                balls, field = meniscus.Balls([[0, 0, 0]], 1.0, colors=colors), meniscus.Field(kernel)
                meniscus.render(balls, camera, field, method=method.name, passes=("combined",), display=display)
    assert len(compiled_programs) >= (len(kernels) if METABALLS in method.displays else 4)
    assert [program for program in compiled_programs if program not in checked_programs] == []
