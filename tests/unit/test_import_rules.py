"""The package keeps its import rules, and the checker sees each kind of violation."""

import import_rules
import pytest


def test_the_package_keeps_the_rules():
    assert import_rules.violations(import_rules.package_files()) == []


def test_the_checker_reads_every_area_of_the_package():
    files = import_rules.package_files()
    assert "__init__.py" in files
    assert {"addon", "samples", "gpu_shaders"} <= {path.split("/")[0] for path in files}


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("addon/fluid/planted.py", "import bpy"),
        ("addon/fluid/planted.py", "import scipy.spatial"),
        ("addon/fluid/planted.py", "from ..render import renderer"),
        ("addon/fluid/planted.py", "from ... import render"),
        ("addon/output/planted.py", "from mathutils import Matrix"),
        ("addon/output/planted.py", "def late():\n    from ..render.renderer import render"),
        ("addon/output/planted.py", "from ..blender import properties"),
        ("addon/render/planted.py", "import bpy_extras.object_utils"),
        ("addon/render/planted.py", "import moderngl"),
        ("addon/render/planted.py", "from ..blender.properties import Scene"),
        ("addon/render/planted.py", "from ..output import exr"),
        ("addon/render/planted.py", "from .. import output"),
        ("addon/blender/planted.py", "from ... import render"),
        ("addon/blender/planted.py", "import moderngl"),
        ("addon/blender/planted.py", "import OpenEXR"),
        ("addon/blender/planted.py", "import meniscus_native"),
        ("addon/blender/planted.py", "from ...samples import dam_break"),
        ("addon/planted/planted.py", "import json"),
        ("gpu_shaders/planted.py", "import gpu"),
        ("gpu_shaders/planted.py", "from ..addon.blender import properties"),
        ("gpu_shaders/planted.py", "from ..addon.render.renderer import render"),
        ("gpu_shaders/planted.py", "import meniscus_native"),
        ("gpu_shaders/methods/planted/params.py", "import moderngl"),
        ("samples/planted.py", "import glcontext"),
        ("samples/planted.py", "import meniscus"),
        ("addon/render/planted.py", "from meniscus.addon.fluid.balls import Balls"),
        ("__init__.py", "import numpy"),
        ("__init__.py", "from .addon.fluid.balls import Balls"),
        ("__init__.py", "try:\n    import bpy\nexcept ImportError:\n    bpy = None"),
    ],
)
def test_a_planted_violation_is_found(path, source):
    packages = {f"addon/{name}/__init__.py": "" for name in ("fluid", "output", "render", "blender")}
    found = import_rules.violations({**packages, path: source})
    assert found
    assert all(sentence.startswith(path) for sentence in found)


def test_opengl_behind_a_methods_parameters_is_found():
    files = {
        "gpu_shaders/__init__.py": "",
        "gpu_shaders/methods/__init__.py": "from ..context import Context",
        "gpu_shaders/context.py": "import moderngl",
        "gpu_shaders/methods/planted/params.py": "import dataclasses",
    }
    (sentence,) = import_rules.violations(files)
    assert sentence.startswith("gpu_shaders/methods/planted/params.py loads moderngl through gpu_shaders/context.py:1")


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("addon/fluid/allowed.py", "import math\nimport numpy.typing as npt\nfrom . import kernels\nfrom .balls import Balls"),
        ("addon/output/allowed.py", "import OpenEXR\nfrom ... import __version__\nfrom ..fluid.image import ImageBuffers"),
        ("addon/render/allowed.py", "import meniscus_native\nfrom ...gpu_shaders import methods\nfrom ..fluid import errors"),
        ("addon/blender/allowed.py", "import bpy, gpu, bl_ui\nfrom ... import __version__\nfrom ..output.exr import write_exr"),
        ("gpu_shaders/allowed.py", "import moderngl\nfrom ..addon.render.method import Method"),
        ("gpu_shaders/methods/allowed/params.py", "def late():\n    import moderngl"),
        ("samples/allowed.py", "import bpy\nfrom PIL import Image\nfrom .. import Balls, render"),
        ("__init__.py", "import importlib\n\n\ndef late():\n    from .addon import blender"),
    ],
)
def test_what_is_allowed_is_not_reported(path, source):
    assert import_rules.violations({path: source}) == []
