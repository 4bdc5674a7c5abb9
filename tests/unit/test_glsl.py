"""The shader preprocessor."""

from __future__ import annotations

import pytest

from meniscus.addon.fluid.errors import DeviceError
from meniscus.gpu_shaders import glsl
from meniscus.gpu_shaders.programs import ProgramSource


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


@pytest.mark.parametrize(
    ("log", "explained"),
    [
        (
            "GLSL Compiler failed\n\ngeometry_shader\n===============\n1:1(9): error: `y' undeclared\n\n",
            "GLSL Compiler failed geometry_shader b.glsl:1(9): error: `y' undeclared",
        ),
        (
            "GLSL Linker failed\n\nProgram\n=======\nVertex info\n-----------\n0(7) : error C1\nFragment info\n0(8) : error C2",
            "GLSL Linker failed Program Vertex info a.glsl(7) : error C1 Fragment info c.glsl(8) : error C2",
        ),
        ("Program\n=======\nerror: v_x is not written", "Program error: v_x is not written"),
    ],
)
def test_logs_of_programs_name_the_files_of_each_stage(shader_folder, log, explained):
    shader_folder(a="int a;\n", g='#include "b.glsl"\n', b="int b;\n", c="int c;\n")
    assert ProgramSource("planted", "a.glsl", "c.glsl", "g.glsl").explain(log) == explained


def test_missing_shader_file_is_named(shader_folder):
    with pytest.raises(DeviceError, match=r"'nowhere\.glsl' cannot be read"):
        glsl.Source("nowhere.glsl", {})
