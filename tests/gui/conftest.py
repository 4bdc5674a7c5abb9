"""Fixtures of the tests in a window; pytest finds them here."""

import ctypes
import importlib

import bpy
import pytest
from blender_fixtures import meniscus, registered_package
from complaints import complaints
from event_loop import turns
from fluid_views import FluidViews

__all__ = ["meniscus", "registered_package", "fluid", "new_file", "no_complaints"]


@pytest.fixture(autouse=True)
def no_complaints(capfd):
    """Blender's standard error must not complain while a test runs. Blender prints through C's own buffer."""
    yield
    ctypes.CDLL(None).fflush(None)
    output, errors = capfd.readouterr()
    print(output)
    assert not complaints(errors), errors


@pytest.fixture
def new_file(registered_package):
    """A factory file with its cube, light and camera; the extension stays enabled."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(2)  # Blender crashes where regions are hidden before they were first drawn
    return bpy.context.window_manager.windows[0]


@pytest.fixture
def fluid(registered_package):
    """The fluid in all viewports."""
    return FluidViews(registered_package)


@pytest.fixture
def drawn_panels(meniscus, monkeypatch):
    """The names of the panels that were drawn, closed ones opened: ask for it before the file, which keeps what is open."""
    panels = importlib.import_module(f"{meniscus.__name__}.addon.blender.panels")
    names = []

    def recorded(draw):
        def draw_and_record(panel, context):
            draw(panel, context)
            names.append(type(panel).__name__)

        return draw_and_record

    panels.unregister()
    with monkeypatch.context() as patch:
        for panel in panels._CLASSES:
            if issubclass(panel, bpy.types.Panel):
                patch.setattr(panel, "bl_options", set(), raising=False)
                patch.setattr(panel, "draw", recorded(panel.draw))
        panels.register()
        yield names
        panels.unregister()
    panels.register()
