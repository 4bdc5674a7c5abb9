"""The settings of the extension in Blender's preferences: they hold for all files."""

from __future__ import annotations

import os
from types import SimpleNamespace

import bpy
from bpy.props import EnumProperty, IntProperty

from .properties import BACKENDS, stable_items

EXTENSION = __package__.removesuffix(".addon.blender")

_DEFAULTS = SimpleNamespace(backend="auto", threads=0, memory_limit=512)


class MENISCUS_AP_preferences(bpy.types.AddonPreferences):
    """What computes images, and what it may take."""

    bl_idname = EXTENSION

    backend: EnumProperty(
        name="Device",
        description="What computes images where a scene leaves the choice",
        items=stable_items(BACKENDS),
        default=_DEFAULTS.backend,
    )
    threads: IntProperty(
        name="Threads",
        description="How many threads the processor may use; 0 for one on each core",
        default=_DEFAULTS.threads,
        min=0,
        soft_max=os.cpu_count() or 1,
        max=1024,
    )
    memory_limit: IntProperty(
        name="Memory Limit (MB)",
        description="How much memory the antialiasing samples of a viewport may take; where it is too little there are fewer",
        default=_DEFAULTS.memory_limit,
        min=16,
        soft_max=4096,
    )

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "backend")
        layout.prop(self, "threads")
        layout.prop(self, "memory_limit")


def preferences() -> MENISCUS_AP_preferences | SimpleNamespace:
    """The user's settings; the defaults where Blender does not know Meniscus as an extension, as in its Python module."""
    addon = bpy.context.preferences.addons.get(EXTENSION)
    return addon.preferences if addon is not None and addon.preferences is not None else _DEFAULTS


def backend_of(scene: bpy.types.Scene) -> str:
    """The back-end that a scene asks for, else the user."""
    return scene.meniscus.backend if scene.meniscus.backend != "auto" else preferences().backend


def threads_of(scene: bpy.types.Scene) -> int:
    """How many threads a render may use by the scene's performance settings, else the user's; 0 for one a core."""
    return int(scene.render.threads) if scene.render.threads_mode == "FIXED" else int(preferences().threads)


def register() -> None:
    """Show the settings in the preferences."""
    bpy.utils.register_class(MENISCUS_AP_preferences)


def unregister() -> None:
    """Remove them; Blender keeps their values."""
    bpy.utils.unregister_class(MENISCUS_AP_preferences)
