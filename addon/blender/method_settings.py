"""The settings of methods, as properties: ``scene.meniscus.method_settings`` has a group for each method that has any."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import PointerProperty

from ..render.method import MethodInfo
from ..render.method_choice import MethodChoice
from ..render.registry import method_info, method_infos
from ..render.settings import Setting, Value
from .changes import note_display
from .preferences import backend_of
from .properties import MENISCUS_PG_scene, setting_property

_groups: list[type[bpy.types.PropertyGroup]] = []
"""Those that are registered, the one that holds the others last."""


def register() -> None:
    """Give scenes the settings of the methods that are registered."""
    owners = {info.name: _group_of(info) for info in method_infos() if info.settings}
    pointers = {name: PointerProperty(type=group, name=group.__doc__) for name, group in owners.items()}
    _registered("method_settings", "Settings of methods", pointers)
    MENISCUS_PG_scene.method_settings = PointerProperty(type=_groups[-1], name="Method Settings")


def unregister() -> None:
    """Take them away; a .blend file keeps its values."""
    del MENISCUS_PG_scene.method_settings
    while _groups:
        group = _groups.pop()
        bpy.utils.unregister_class(group)
        # The bpy wheels 4.2 and 4.5 crash where a property with a callback is alive when Python ends.
        group.__annotations__.clear()


def group_of(settings: bpy.types.PropertyGroup, method: str) -> bpy.types.PropertyGroup | None:
    """The properties of a method among the settings of a scene; None where it has no settings."""
    return getattr(settings.method_settings, method, None)


def read_choice(scene: bpy.types.Scene, method: str | None = None, backend: str | None = None) -> MethodChoice:
    """What a scene says of the method, with the settings that it has for that.

    Parameters
    ----------
    scene
        Whose settings are read.
    method, backend
        What counts in place of the scene's choice.

    Raises
    ------
    InputError
        There is no such method.
    """
    name = method or scene.meniscus.method
    settings = {} if name == "auto" else _read(group_of(scene.meniscus, name), method_info(name))
    return MethodChoice(name, backend or backend_of(scene), settings)


def _read(group: bpy.types.PropertyGroup | None, info: MethodInfo) -> dict[str, Value]:
    return {setting.name: _plain(getattr(group, setting.name), setting) for setting in info.settings}


def _plain(value: Value, setting: Setting) -> Value:
    """What a property holds, without the digits that 32 bits add to a number with decimals."""
    if not isinstance(setting.default, float):
        return value
    return min(max(float(f"{value:.7g}"), setting.minimum), setting.maximum)


def _group_of(info: MethodInfo) -> type[bpy.types.PropertyGroup]:
    properties = {setting.name: setting_property(setting, note_display) for setting in info.settings}
    return _registered(info.name, f"Settings of {info.label}", properties)


def _registered(name: str, description: str, properties: dict[str, Any]) -> type[bpy.types.PropertyGroup]:
    parts = {"__doc__": description, "__annotations__": properties, "__module__": __name__}
    group = type(f"MENISCUS_PG_{name}", (bpy.types.PropertyGroup,), parts)
    bpy.utils.register_class(group)
    _groups.append(group)
    return group
