"""What of a scene may be elsewhere in other frames, as Cycles decides it: by what could move it, without looking there."""

from __future__ import annotations

import bpy


def place_may_move(item: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Whether an object itself, not an instance of it, may stand elsewhere in other frames; as for :func:`may_move`."""
    if item.animation_data or item.constraints or item.rigid_body:
        return True
    return item.parent is not None and may_move(item.parent, scene)


def may_move(item: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Whether an object, or the surface that it has, may be elsewhere in other frames.

    Parameters
    ----------
    item
        Evaluated.
    scene
        The original scene.
    """
    has_animation = bool(item.particle_systems or getattr(item.data, "animation_data", None))
    return has_animation or place_may_move(item, scene) or item.is_deform_modified(scene, "RENDER")
