"""The lint of the shaders: it sees each kind of fault, names our files, and lets pass what is right."""

from __future__ import annotations

import subprocess

import pytest
import shader_lint
from project import ToolError

from meniscus.gpu_shaders import glsl
from meniscus.gpu_shaders.programs import ProgramSource

LOOP = "void main() {\n    %s\n        work();\n}\n"


@pytest.mark.parametrize(
    "loop",
    [
        "while (true)",
        "do work(); while (x < 3);",
        "for (;;)",
        "for (int i = 0; ; i++)",
        "for (int i = 0; i < ids; i++)",
        "for (int i = 0; i < min(ids, others); i++)",
        "for (int i = 0; x < 3; i++)",
        "for (int i = 0; i < 3; )",
        "for (int i = 0; i < 3; x++)",
        "for (int i = 3; i >= 0; i--)",
        "for (int i = 0; i < 3 || x; i++)",
        "for (float x = 0.0; x < 1.0; x += 0.1)",
    ],
)
def test_a_loop_without_a_bound_is_found(loop):
    found = shader_lint.rule_violations({"lib/planted.glsl": LOOP % loop})
    assert found
    assert all(sentence.startswith("lib/planted.glsl:2 ") for sentence in found)


@pytest.mark.parametrize(
    "loop",
    [
        "for (int i = 0; i < 14; i++)",
        "for (uint i = 0u; i <= 2u * MAX_DEGREE + 1u; ++i)",
        "for (int i = 0; i < 3; i++) for (int j = i + 1; j <= KERNEL_DEGREE - i; j += 2)",
        "for (uint i = 0u; i < state.count; i++)",
        "for (uint i = 0u; i < min(length, MAX_LENGTH); i++)",
        "for (int i = max(f(0), 1); i < int(MAX_BALLS) && !done; i++)",
        "// while we are here: for (;;)",
        "/* while\n */",
        "int meanwhile = 3;",
    ],
)
def test_a_loop_with_a_bound_is_not_reported(loop):
    assert shader_lint.rule_violations({"lib/planted.glsl": LOOP % loop}) == []


@pytest.mark.parametrize(
    ("path", "include", "is_allowed"),
    [
        ("methods/a/x.frag", "lib/y.glsl", True),
        ("methods/a/x.frag", "methods/a/y.glsl", True),
        ("methods/a/x.frag", "methods/b/y.glsl", False),
        ("methods/a/x.frag", "methods/ab/y.glsl", False),
        ("lib/x.glsl", "lib/y.glsl", True),
        ("lib/x.glsl", "methods/a/y.glsl", False),
    ],
)
def test_includes_stay_in_the_library_and_the_own_folder(path, include, is_allowed):
    found = shader_lint.rule_violations({path: f'// 1\n#include "{include}"\n'})
    assert [sentence.split(":")[:2] for sentence in found] == ([] if is_allowed else [[path, "2 includes " + include]])


def test_every_shader_file_is_read():
    files = shader_lint.shader_files()
    assert {"lib/kernel.glsl", "methods/depth_peeling/peel.frag", "methods/depth_peeling/sphere.vert"} <= files.keys()


def test_every_shader_is_in_one_of_the_programs():
    programs = [*shader_lint.method_programs(), *shader_lint.viewport_programs()]
    used = {source for program in programs for stage in program.sources().values() for source in stage.files}
    used |= {f"viewport/{program.name}_params.glsl" for program in shader_lint.viewport_programs()}
    assert used == shader_lint.shader_files().keys()


FINE = {
    "a.vert": "out vec3 v_color;\nvoid main() { v_color = vec3(1.0); gl_Position = vec4(1.0); }\n",
    "b.geom": "layout(points) in;\nlayout(points, max_vertices = 1) out;\nvoid main() { EmitVertex(); }\n",
    "c.frag": '#include "d.glsl"\nin vec3 v_color;\nout vec4 color;\nvoid main() { color = vec4(v_color, half_of(1.0)); }\n',
    "d.glsl": "float half_of(float x) {\n    return 0.5 * x;\n}\n",
}
PROGRAM = ProgramSource("planted", "a.vert", "c.frag")


@pytest.fixture
def findings(tmp_path, monkeypatch):
    """Gives a program of these files, some of them changed, to the compiler."""
    if not shader_lint.has_validator():
        pytest.skip(f"{shader_lint.VALIDATOR} is missing")
    monkeypatch.setattr(glsl, "ROOT", tmp_path)

    def check(program=PROGRAM, **changed):
        for name, text in (FINE | {name.replace("_", "."): text for name, text in changed.items()}).items():
            (tmp_path / name).write_text(text)
        return shader_lint.compiler_findings([program, program])

    return check


def test_a_right_program_has_no_findings(findings):
    assert findings() == []


@pytest.mark.parametrize(
    ("changed", "place"),
    [
        ({"d_glsl": FINE["d.glsl"].replace("0.5 * x", "y")}, "a.vert + c.frag: ERROR: d.glsl:2: 'y' : undeclared"),
        ({"c_frag": FINE["c.frag"].replace("1.0", "oops")}, "a.vert + c.frag: ERROR: c.frag:4: 'oops' : undeclared"),
        ({"a_vert": f"{FINE['a.vert']}\n\nfloat x = ;\n"}, "a.vert + c.frag: ERROR: a.vert:5: "),
        ({"c_frag": f"#extension GL_NONE_such : warn\n{FINE['c.frag']}"}, "a.vert + c.frag: WARNING: c.frag:1: "),
        (
            {"a_vert": FINE["a.vert"].replace("vec3", "vec2")},
            "a.vert + c.frag: ERROR: Linking vertex and fragment stages: Types must",
        ),
    ],
)
def test_what_the_compiler_finds_names_our_files_once(findings, changed, place):
    found = findings(**changed)
    assert sum(sentence.startswith(place) for sentence in found) == 1, found


def test_geometry_shaders_and_programs_without_fragment_shaders_are_compiled(findings):
    program = ProgramSource("planted", "a.vert", geometry="b.geom")
    assert findings(program) == []
    assert "b.geom:2" in findings(program, b_geom=FINE["b.geom"].replace("1", "x"))[0]


def test_a_compiler_that_dies_is_a_finding(findings, monkeypatch):
    monkeypatch.setattr(
        shader_lint.subprocess, "run", lambda command, **options: subprocess.CompletedProcess(command, -11, "", "")
    )
    assert findings() == ["a.vert + c.frag: glslangValidator failed with exit status -11"]


def test_without_the_compiler_it_says_so_and_fails_in_ci(monkeypatch, capsys):
    monkeypatch.setattr(shader_lint, "ensure_test_programs", lambda: None)
    monkeypatch.setattr(shader_lint.shutil, "which", lambda program: None)
    monkeypatch.delenv("CI", raising=False)
    shader_lint.check_shaders()
    assert capsys.readouterr().out.startswith("NOT CHECKED: glslangValidator is missing")
    monkeypatch.setenv("CI", "true")
    with pytest.raises(ToolError, match=r"install the package glslang-tools\.$"):
        shader_lint.check_shaders()


def test_constants_reach_every_stage():
    program = ProgramSource("planted", "lib/ray.glsl", "lib/ray.glsl", "lib/ray.glsl", constants=(("SIZE", 3),))
    sources = program.sources()
    assert list(sources) == ["vertex", "geometry", "fragment"]
    assert all("#define SIZE 3\n" in source.text for source in sources.values())
