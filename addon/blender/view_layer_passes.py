"""Which passes a view layer asks for."""

from __future__ import annotations

import bpy

from ..fluid.passes import PASSES, Pass

BLENDER_SWITCHES = {
    "depth": "use_pass_z",
    "normal": "use_pass_normal",
    "position": "use_pass_position",
    "vector": "use_pass_vector",
    "object_index": "use_pass_object_index",
}
"""The switches of Blender's view layers that passes have; the others have one of ours."""


def wanted_passes(view_layer: bpy.types.ViewLayer) -> list[Pass]:
    """The passes that a view layer asks for, Combined first."""
    return [image_pass for name, image_pass in PASSES.items() if name == "combined" or _is_wanted(view_layer, name)]


def cryptomatte_levels(view_layer: bpy.types.ViewLayer) -> int:
    """How many objects a pixel names in the mattes that a view layer asks for; 0 for no mattes."""
    return view_layer.pass_cryptomatte_depth if view_layer.use_pass_cryptomatte_object else 0


def _is_wanted(view_layer: bpy.types.ViewLayer, name: str) -> bool:
    if name in BLENDER_SWITCHES:
        return bool(getattr(view_layer, BLENDER_SWITCHES[name]))
    return bool(getattr(view_layer.meniscus, f"use_pass_{name}"))
