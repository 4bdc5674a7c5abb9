"""Every shader, as the driver gets it, against the reference compiler: software OpenGL forgives what drivers do not."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

import meniscus
from meniscus.addon.fluid.kernels import KERNELS
from meniscus.addon.render.registry import method_infos
from meniscus.gpu_shaders import context

GPU_METHODS = [info.name for info in method_infos() if info.backend == "gpu"]


@pytest.fixture
def compiled_shaders(opengl, monkeypatch):
    """Collects the text of all shaders that are compiled from now on, by path."""
    texts = []

    class Recorder(context.Source):
        def __init__(self, path, constants, version=330):
            super().__init__(path, constants, version)
            texts.append((path, self.text))

    monkeypatch.setattr(context, "Source", Recorder)
    monkeypatch.setattr(opengl, "_programs", {})
    return texts


@pytest.fixture
def validator():
    """The reference compiler of GLSL. Only a developer's own machine may do without."""
    program = shutil.which("glslangValidator")
    if program is None:
        give_up = pytest.fail if os.environ.get("CI") else pytest.skip
        give_up("glslangValidator is missing; install the package glslang-tools")
    return program


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("method", GPU_METHODS)
def test_shaders_are_valid(method, kernel, compiled_shaders, validator, tmp_path):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=8, height=8)
    for colors in (None, (1, 0, 0)):
        balls = meniscus.Balls([[0, 0, 0]], 1.0, colors=colors)
        meniscus.render(balls, camera, meniscus.Field(kernel), method=method, passes=("combined",))
    assert len(compiled_shaders) >= 2
    for index, (path, text) in enumerate(compiled_shaders):
        shader = tmp_path / f"{index}.{path.rpartition('.')[2]}"
        shader.write_text(text)
        result = subprocess.run([validator, str(shader)], capture_output=True, text=True, check=False)
        assert result.returncode == 0, f"{path}:\n{result.stdout}"
        assert "WARNING" not in result.stdout, f"{path}:\n{result.stdout}"
