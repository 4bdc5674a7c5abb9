"""The extension inside Blender: properties, panels, reading of scenes, commands. The only package that imports bpy."""

from __future__ import annotations

import importlib
from types import ModuleType

_SUBMODULES = ("properties", "panels", "command_line")
"""What has something to register, in the order of registering."""


def register() -> None:
    """Register everything with Blender."""
    for module in _modules():
        module.register()


def unregister() -> None:
    """Undo `register`, the last first."""
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list[ModuleType]:
    return [importlib.import_module(f".{name}", __package__) for name in _SUBMODULES]
