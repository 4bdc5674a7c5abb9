"""The extension as Blender sees it: enabling, disabling, its properties, its manifest, its wheels."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import bpy
import pytest


def registered_classes() -> set[str]:
    return {name for name in dir(bpy.types) if name.startswith("MENISCUS_")}


def test_scene_and_objects_carry_the_properties(meniscus, empty_scene):
    thing = bpy.data.objects.new("thing", None)
    assert isinstance(empty_scene.meniscus, bpy.types.PropertyGroup)
    assert isinstance(thing.meniscus, bpy.types.PropertyGroup)


def test_disabling_leaves_nothing_and_enabling_again_brings_all_back(meniscus):
    classes = registered_classes()
    assert classes
    for _ in range(2):
        meniscus.unregister()
        assert registered_classes() == set()
        assert not hasattr(bpy.types.Scene, "meniscus")
        assert not hasattr(bpy.types.Object, "meniscus")
        meniscus.register()
        assert registered_classes() == classes


def test_properties_survive_a_save_and_a_load(meniscus, empty_scene, tmp_path):
    thing = bpy.data.objects.new("thing", None)
    empty_scene.collection.objects.link(thing)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert isinstance(bpy.data.objects["thing"].meniscus, bpy.types.PropertyGroup)


def test_version_is_the_manifests(meniscus):
    manifest = (Path(meniscus.__file__).parent / "blender_manifest.toml").read_text()
    assert f'version = "{meniscus.__version__}"' in manifest.splitlines()


@pytest.mark.parametrize("module", ["moderngl", "glcontext", "OpenEXR"])
def test_a_wheel_fits_this_blender(meniscus, module):
    assert importlib.util.find_spec(module) is not None


def test_enabling_imports_neither_opengl_nor_openexr(meniscus):
    root = Path(meniscus.__file__).parent
    code = (
        "import importlib.util, sys\n"
        f"path = {str(root)!r}\n"
        "spec = importlib.util.spec_from_file_location('fresh', path + '/__init__.py', submodule_search_locations=[path])\n"
        "package = sys.modules['fresh'] = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(package)\n"
        "package.register()\n"
        "print('loaded:', *sorted({'moderngl', 'glcontext', 'OpenEXR'} & set(sys.modules)))\n"
        "package.unregister()  # the bpy wheels 4.2 and 4.5 crash when Python ends with classes registered\n"
    )
    command = [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1", "--python-expr", code]
    if not bpy.app.binary_path:
        command = [sys.executable, "-c", "import bpy\n" + code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("loaded:")] == ["loaded:"]
