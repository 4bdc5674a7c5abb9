"""The extension inside Blender: properties, panels, reading of scenes, commands. The only package that imports bpy."""

from __future__ import annotations

import atexit
import importlib
from types import ModuleType

_SUBMODULES = (
    "properties",
    "method_settings",
    "preferences",
    "version_update",
    "operators",
    "engine",
    "export",
    "particle_operators",
    "panels",
    "changes",
    "surface_particles",
    "command_line",
    "viewport",
)
"""What has something to register, in the order of registering."""


def register() -> None:
    """Register everything with Blender."""
    for module in _modules():
        module.register()
    # The program disables its extensions before it quits. The Python module does not, and crashes (commands) or hangs
    # (panels) at its exit, up to 4.5.
    atexit.register(unregister)


def unregister() -> None:
    """Undo `register`, the last first."""
    atexit.unregister(unregister)
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list[ModuleType]:
    return [importlib.import_module(f".{name}", __package__) for name in _SUBMODULES]
