"""The extension, registered, under a bpy wheel as well as inside a real Blender."""

import ctypes
import importlib
from collections.abc import Iterator
from types import ModuleType

import bpy
import pytest

EXTENSION = "bl_ext.user_default.meniscus"


def runs_inside_program() -> bool:
    """Whether this is the real Blender, where the installed and enabled zip is tested, or the Python module."""
    return bool(bpy.app.binary_path)


@pytest.fixture(autouse=True)
def blender_output() -> Iterator[None]:
    """Empty C's own output buffer, through which Blender prints, while pytest still captures: it belongs to this test."""
    yield
    ctypes.CDLL(None).fflush(None)


@pytest.fixture(scope="session")
def registered_package() -> Iterator[ModuleType]:
    if runs_inside_program():
        yield importlib.import_module(EXTENSION)
        return
    package = importlib.import_module("meniscus")
    package.register()
    yield package
    package.unregister()


@pytest.fixture
def meniscus(registered_package: ModuleType) -> ModuleType:
    """The package under whatever name it has here; it is registered."""
    return registered_package


@pytest.fixture
def empty_scene(registered_package: ModuleType) -> bpy.types.Scene:
    """A fresh factory scene without objects; the extension stays registered.

    `wm.read_factory_settings` would reset the preferences as well, and with them disable the extension.
    """
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    return bpy.context.scene
