"""Checks the shaders without OpenGL: every program of every method by the reference compiler, and our own rules.

.venv/bin/python tools/shader_lint.py

The compiler gets the very text that the driver gets (gpu_shaders/glsl.py makes it). The rules:

- Loops count up to a bound that the compiler knows, or to a count that was clamped: a graphics processor that loops for ever
  is reset, and the image of everything else with it.
- A method includes files of lib/ and its own; lib/ includes only files of lib/.
"""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from project import ROOT, ToolError, command_line
from system_packages import TEST_PROGRAMS, ensure_test_programs

from meniscus.addon.render.registry import method_infos
from meniscus.gpu_shaders.glsl import Source, explain
from meniscus.gpu_shaders.programs import ProgramSource
from meniscus.gpu_shaders.viewport.programs import ViewportProgram
from meniscus.gpu_shaders.viewport.programs import all_programs as viewport_programs

SHADERS = ROOT / "gpu_shaders"
VALIDATOR = "glslangValidator"
# The suffixes by which the compiler knows the stages.
SUFFIXES = {"vertex": ".vert", "geometry": ".geom", "fragment": ".frag", "compute": ".comp"}
SHADER_SUFFIXES = (*SUFFIXES.values(), ".glsl")

COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
INCLUDE = re.compile(r'^\s*#include "([^"]+)"', re.MULTILINE)
WHILE = re.compile(r"\bwhile\b")
FOR = re.compile(r"\bfor\s*\(")
LOOP_VARIABLE = re.compile(r"\bfor\s*\(\s*u?int\s+(\w+)\s*=")
NAME = re.compile(r"\b[A-Za-z_][\w.]*")
CONSTANT = re.compile(r"\b(?:[A-Z][A-Z0-9_]*|\d+u?)\b")
CLAMP = re.compile(r"\b(?:min|clamp)\s*\(")


def method_programs() -> list[ProgramSource]:
    """The programs of all registered methods on OpenGL, and of what works on their surfaces; no OpenGL is needed for it."""
    names = [f"methods.{info.name}" for info in method_infos() if info.backend == "gpu"]
    modules = [importlib.import_module(f"meniscus.gpu_shaders.{name}.programs") for name in [*names, "tracing"]]
    return [program for module in modules for program in module.all_programs()]


def compiler_findings(programs: Iterable[ProgramSource | ViewportProgram]) -> list[str]:
    """What the reference compiler says against programs, with the names of our files."""
    sources = [program.sources() for program in programs]
    # Many constants matter to few shaders.
    distinct = list({tuple(source.text for source in stages.values()): stages for stages in sources}.values())
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor() as threads:
        folders = [Path(folder) / str(number) for number in range(len(distinct))]
        found = [sentence for part in threads.map(check_program, folders, distinct) for sentence in part]
    return list(dict.fromkeys(found))


def check_program(folder: Path, stages: Mapping[str, Source]) -> list[str]:
    """Compile and link one program, its texts written to `folder`."""
    folder.mkdir()
    paths = {str(folder / f"shader{SUFFIXES[stage]}"): source for stage, source in stages.items()}
    for path, source in paths.items():
        Path(path).write_text(source.text, encoding="utf-8")
    done = subprocess.run([VALIDATOR, "-l", *paths], capture_output=True, text=True, check=False)
    lines = [line.strip() for line in explain(done.stdout + done.stderr, paths).splitlines()]
    found = [line for line in lines if line and line not in paths]
    files = " + ".join(source.files[0] for source in stages.values())
    if done.returncode and not found:
        found = [f"{VALIDATOR} failed with exit status {done.returncode}"]
    return [f"{files}: {line}" for line in found]


def rule_violations(files: Mapping[str, str]) -> list[str]:
    """What in shader files breaks our rules, one sentence each.

    Parameters
    ----------
    files
        The text of each file by its path below gpu_shaders/, with forward slashes.
    """
    found = []
    for path, text in files.items():
        code = COMMENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
        places = [*loops_without_bound(code), *foreign_includes(path, code)]
        found += [f"{path}:{code.count(chr(10), 0, position) + 1} {reason}." for position, reason in sorted(places)]
    return found


def loops_without_bound(code: str) -> Iterator[tuple[int, str]]:
    for match in WHILE.finditer(code):
        yield match.start(), "loops with 'while': count up to a bound with 'for'"
    variables = set(LOOP_VARIABLE.findall(code))
    for match in FOR.finditer(code):
        parts = loop_header(code, match.end()).split(";")
        if len(parts) != 3 or not counts_up(parts, variables):
            yield match.start(), "has a loop that does not count up to a constant, a loop's variable or a clamped count"


def loop_header(code: str, begin: int) -> str:
    """What stands between the parentheses that open before `begin`."""
    depth = 1
    for end in range(begin, len(code)):
        depth += {"(": 1, ")": -1}.get(code[end], 0)
        if depth == 0:
            return code[begin:end]
    return code[begin:]


def counts_up(parts: list[str], variables: set[str]) -> bool:
    """Whether a loop's three parts are a start, a bound (maybe with other conditions) and a step upwards."""
    start, condition, step = parts
    variable = re.fullmatch(r"\s*u?int\s+(\w+)\s*=.*", start, re.DOTALL)
    if variable is None:
        return False
    name = re.escape(variable.group(1))
    if not re.fullmatch(rf"\s*(?:{name}\s*\+\+|\+\+\s*{name}|{name}\s*\+=\s*{CONSTANT.pattern})\s*", step):
        return False
    bounds = [re.fullmatch(rf"\s*{name}\s*<=?(.*)", clause, re.DOTALL) for clause in condition.split("&&")]
    return any(bound is not None and is_limited(bound.group(1), variables) for bound in bounds)


def is_limited(bound: str, variables: set[str]) -> bool:
    """Whether a bound is made of constants, loops' variables and counts, which are clamped where they are made."""
    if CLAMP.search(bound) and CONSTANT.search(bound):
        return True
    names = set(NAME.findall(bound)) - variables - {"int", "uint"}
    return all(CONSTANT.fullmatch(name) or name.endswith("count") for name in names)


def foreign_includes(path: str, code: str) -> Iterator[tuple[int, str]]:
    own = "/".join(path.split("/")[:2]) + "/" if path.startswith("methods/") else "lib/"
    for match in INCLUDE.finditer(code):
        if not match.group(1).startswith(("lib/", own)):
            reason = f"includes {match.group(1)}: only files of lib/ and of the method's own folder may be"
            yield match.start(1), reason


def shader_files(root: Path = SHADERS) -> dict[str, str]:
    """The texts of all shader files."""
    paths = sorted(path for path in root.rglob("*") if path.suffix in SHADER_SUFFIXES)
    return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def has_validator() -> bool:
    """Whether the reference compiler is there; it is installed where that is possible, and in CI it must be there."""
    ensure_test_programs()
    if shutil.which(VALIDATOR):
        return True
    sentence = f"{VALIDATOR} is missing, so no shader was compiled: install the package {TEST_PROGRAMS[VALIDATOR]}."
    if os.environ.get("CI"):
        raise ToolError(sentence)
    print(f"NOT CHECKED: {sentence}", flush=True)
    return False


def check_shaders() -> None:
    """Check all shader files; ToolError with what was found."""
    found = rule_violations(shader_files())
    if has_validator():
        found += compiler_findings([*method_programs(), *viewport_programs()])
    if found:
        raise ToolError("the shaders have faults.\n" + "\n".join(found))


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("shader_lint.py takes no arguments")
    check_shaders()
    print("The shaders are valid.", flush=True)


if __name__ == "__main__":
    command_line(main)
