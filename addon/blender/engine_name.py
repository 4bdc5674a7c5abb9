"""The name by which Blender knows the render engine."""

from __future__ import annotations

import bpy

ENGINE = "MENISCUS"


def is_engine_view(context: bpy.types.Context) -> bool:
    """Whether a viewport shows what the render engine draws."""
    return context.space_data.shading.type == "RENDERED" and context.scene.render.engine == ENGINE
