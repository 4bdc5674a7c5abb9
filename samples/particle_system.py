"""Blender's own particle simulation, set up and baked without an interface. Uses bpy."""

from __future__ import annotations

import bpy


def add_particle_system(item: bpy.types.Object, *, seed: int, frame_end: int) -> bpy.types.ParticleSystem:
    """A particle system on `item` whose particles live until `frame_end` and whose cache holds all frames."""
    item.modifiers.new("Particles", "PARTICLE_SYSTEM")
    system = item.particle_systems[-1]
    system.seed = seed
    system.point_cache.frame_start, system.point_cache.frame_end = 1, frame_end
    settings = system.settings
    settings.frame_start = settings.frame_end = 1
    settings.lifetime = frame_end + 1
    settings.normal_factor = 0.0
    return system


def add_collision(item: bpy.types.Object, *, damping: float, friction: float) -> None:
    """Let particles bounce off `item`; both factors go from 0 (none is lost) to 1 (all is)."""
    item.modifiers.new("Collision", "COLLISION")
    item.collision.damping_factor = damping
    item.collision.friction_factor = friction


def bake(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Simulate the last particle system of `item` over the frames of its cache, which a saved .blend file then holds.

    Raises
    ------
    RuntimeError
        Blender did not bake.
    """
    cache = item.particle_systems[-1].point_cache
    with bpy.context.temp_override(scene=scene, active_object=item, point_cache=cache):
        bpy.ops.ptcache.bake(bake=True)
    if not cache.is_baked:
        raise RuntimeError(f"Blender did not bake the particles of '{item.name}'")
