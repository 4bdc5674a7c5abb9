"""Who may import what: data flows one way, and each foreign package has one home.

python3 tools/import_rules.py     check every Python file of the package
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from project import ROOT, ToolError, command_line

BLENDER = frozenset({"bpy", "bpy_extras", "mathutils", "gpu", "gpu_extras", "blf", "bmesh", "imbuf", "idprop", "aud", "bgl"})
OPENGL = frozenset({"moderngl", "glcontext"})

# What a method is, and what the native core makes for shaders to read.
FOR_METHODS = (
    "addon/render/method",
    "addon/render/settings",
    "addon/render/fitted_bvh",
    "addon/render/tree_builder",
    "addon/render/neighbours",
    "addon/render/glyphs",
    "addon/render/surface_particles",
    "addon/render/particle_follower",
    "addon/render/particle_settings",
)


@dataclass(frozen=True)
class Area:
    """A folder of the package, the folders of the package that it may import from, and the foreign packages it may import.

    `foreign` names those besides the standard library; None leaves all but the ones that have a home elsewhere.
    """

    folder: str
    project: tuple[str, ...]
    foreign: frozenset[str] | None


# A file belongs to the first area whose folder it lies in.
AREAS = (
    Area("addon/fluid", ("addon/fluid",), frozenset({"numpy"})),
    Area("addon/output", ("addon/fluid", "addon/output"), frozenset({"numpy", "OpenEXR"})),
    Area("addon/render", ("addon/fluid", "addon/render", "gpu_shaders"), frozenset({"numpy", "meniscus_native"})),
    Area("addon/blender", ("addon", "gpu_shaders"), BLENDER | {"numpy"}),
    Area("gpu_shaders", ("addon/fluid", *FOR_METHODS, "gpu_shaders"), OPENGL | {"numpy"}),
    Area("samples", ("addon", "gpu_shaders", "samples", ""), None),
)

# What the package itself offers besides its interface, which is for users and the samples.
VERSION = "__version__"

# The light modules that the package may import at once, whether it is used or only enabled.
LIGHT = frozenset({"__future__", "importlib", "typing"})

# Areas without a list of their own may import anything but these.
HOMES = {**dict.fromkeys(OPENGL, "gpu_shaders"), "meniscus_native": "addon/render"}

# The interface loads these on machines without OpenGL.
PARAMETERS = "gpu_shaders/methods/*/params.py"


@dataclass(frozen=True)
class Import:
    """An import statement's target: a foreign package's name, or a path in the project.

    What is imported from the package itself has the path '', its version the path '__version__'.
    """

    line: int
    target: str
    is_project: bool
    is_at_module_level: bool


def violations(files: Mapping[str, str]) -> list[str]:
    """What breaks the rules, one sentence each.

    Parameters
    ----------
    files
        The source of each Python file by its path from the package's root, with forward slashes.
    """
    imports = {path: list(imports_of(path, source, files)) for path, source in files.items()}
    found = [sentence for path in files for sentence in check_file(path, imports[path])]
    parameters = [path for path in files if fnmatch(path, PARAMETERS)]
    return found + [sentence for path in parameters for sentence in check_parameters(path, imports)]


def check_file(path: str, imports: list[Import]) -> Iterator[str]:
    for item in imports:
        reason = why_forbidden(path, item)
        if reason:
            yield f"{path}:{item.line} imports {item.target or 'the package itself'}: {reason}."


def why_forbidden(path: str, item: Import) -> str:
    """Why this file may not have this import; empty if it may."""
    if not item.is_project and item.target == "meniscus":
        return "inside the package imports are relative, its name differs between Blender and elsewhere"
    if path == "__init__.py":
        return why_too_heavy(item)
    area = area_of(path)
    if area is None:
        return "" if path == "addon/__init__.py" else "the folder is in no area of tools/import_rules.py"
    if item.is_project:
        return why_project_forbidden(area, item.target)
    return why_foreign_forbidden(area, item.target)


def why_too_heavy(item: Import) -> str:
    if item.is_at_module_level and (item.is_project or item.target not in LIGHT):
        return "enabling the extension must stay instant, so the package imports it when it is first used"
    return ""


def why_project_forbidden(area: Area, target: str) -> str:
    if target == VERSION or any(target == folder or target.startswith(f"{folder}/") for folder in area.project):
        return ""
    return f"{area.folder} may import only {', '.join(area.project)} from the package"


def why_foreign_forbidden(area: Area, target: str) -> str:
    if target in sys.stdlib_module_names:
        return ""
    if area.foreign is None:
        return f"only {HOMES[target]} may" if target in HOMES else ""
    if target in area.foreign or (is_blender(target) and "bpy" in area.foreign):
        return ""
    return f"{area.folder} may import only {', '.join(sorted(area.foreign))} besides the standard library"


def is_blender(target: str) -> bool:
    return target in BLENDER or target.startswith("bl_")


def area_of(path: str) -> Area | None:
    return next((area for area in AREAS if path.startswith(f"{area.folder}/")), None)


def check_parameters(path: str, imports: Mapping[str, list[Import]]) -> Iterator[str]:
    """Follow what a method's params.py loads; OpenGL must not be among it."""
    for loaded in loaded_files(path, imports):
        for item in imports[loaded]:
            if item.is_at_module_level and item.target in OPENGL and not item.is_project:
                yield f"{path} loads {item.target} through {loaded}:{item.line}: the interface must load without OpenGL."


def loaded_files(start: str, imports: Mapping[str, list[Import]]) -> set[str]:
    """All files of the project that are run when one is imported, itself included."""
    loaded: set[str] = set()
    waiting = [start]
    while waiting:
        path = waiting.pop()
        if path in loaded:
            continue
        loaded.add(path)
        targets = [item.target for item in imports[path] if item.is_project and item.is_at_module_level]
        waiting += [path for target in [path.removesuffix(".py"), *targets] for path in files_of(target, imports)]
    return loaded


def files_of(target: str, files: Mapping[str, object]) -> list[str]:
    """The files that run when a module of the project is imported: its packages' and its own."""
    parts = target.split("/")
    packages = ["/".join([*parts[:depth], "__init__.py"]) for depth in range(len(parts) + 1)]
    return [path for path in [*packages, f"{target}.py"] if path in files]


def imports_of(path: str, source: str, files: Mapping[str, object]) -> Iterator[Import]:
    tree = ast.parse(source, path)
    top = set(module_level_nodes(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(node.lineno, alias.name.split(".")[0], False, node in top)
        elif isinstance(node, ast.ImportFrom):
            for target, is_project in targets_of(path, node, files):
                yield Import(node.lineno, target, is_project, node in top)


def module_level_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that run on import: not those in functions, nor those for type checkers only."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            continue
        if isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            continue
        yield child
        yield from module_level_nodes(child)


def targets_of(path: str, node: ast.ImportFrom, files: Mapping[str, object]) -> Iterator[tuple[str, bool]]:
    if node.level == 0:
        yield (node.module or "").split(".")[0], False
        return
    folders = path.split("/")[: -node.level]
    base = "/".join([*folders, *(node.module or "").split(".")]).strip("/")
    for alias in node.names:
        module = f"{base}/{alias.name}".strip("/")
        is_module = f"{module}.py" in files or f"{module}/__init__.py" in files or module == VERSION
        yield module if is_module else base, True


def package_files(root: Path = ROOT) -> dict[str, str]:
    """The sources of the package's Python files."""
    folders = sorted({area.folder.split("/")[0] for area in AREAS})
    paths = [root / "__init__.py", *(path for folder in folders for path in sorted((root / folder).rglob("*.py")))]
    return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def main(arguments: list[str]) -> None:
    if arguments:
        raise ToolError("import_rules.py takes no arguments")
    found = violations(package_files())
    if found:
        raise ToolError("the import rules are broken.\n" + "\n".join(found))
    print("The import rules hold.", flush=True)


if __name__ == "__main__":
    command_line(main)
