"""The shader preprocessor."""

from __future__ import annotations

import pytest

from meniscus.addon.fluid.errors import DeviceError
from meniscus.gpu_shaders import glsl


@pytest.fixture
def shader_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(glsl, "ROOT", tmp_path)

    def write(**files):
        for name, text in files.items():
            (tmp_path / f"{name}.glsl").write_text(text)

    return write


def test_includes_nest_and_come_once(shader_folder):
    shader_folder(
        a='#include "b.glsl"\n#include "c.glsl"\nvoid a() {}\n', b='#include "c.glsl"\nvoid b() {}\n', c="void c() {}\n"
    )
    source = glsl.Source("a.glsl", {"SIZE": 3})
    code = [line for line in source.text.splitlines() if not line.startswith("#line")]
    assert code == ["#version 330 core", "#define SIZE 3", "void c() {}", "void b() {}", "void a() {}"]
    assert source.files == ["a.glsl", "b.glsl", "c.glsl"]


def test_line_numbers_lead_back_to_the_files(shader_folder):
    shader_folder(a='int one;\n#include "b.glsl"\nint three;\n', b="int other;\n")
    lines = glsl.Source("a.glsl", {}).text.splitlines()
    assert lines[lines.index("int three;") - 1] == "#line 3 0"
    assert lines[lines.index("int other;") - 1] == "#line 1 1"


def test_compiler_logs_name_the_files(shader_folder):
    shader_folder(a='#include "b.glsl"\n', b="int x = y;\n")
    source = glsl.Source("a.glsl", {})
    assert source.explain("1:1(9): error: `y' undeclared") == "b.glsl:1(9): error: `y' undeclared"
    assert source.explain("0(7) : error C1503") == "a.glsl(7) : error C1503"


def test_missing_shader_file_is_named(shader_folder):
    with pytest.raises(DeviceError, match=r"'nowhere\.glsl' cannot be read"):
        glsl.Source("nowhere.glsl", {})
