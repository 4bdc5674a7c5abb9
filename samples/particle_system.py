"""Blender's own particle simulation, set up and baked without an interface. Uses bpy."""

from __future__ import annotations

import math

from ..addon.fluid.errors import MeniscusError
from .one_thread import bpy

SMOOTHING = 1.2
"""Smoothing length of the SPH kernel, particle spacings; the kernel reaches twice as far."""
COURANT = 0.5
"""Greatest share of the smoothing length that sound crosses in a step."""
MASS = 0.01
"""Of a particle; it only brings the other numbers into the ranges that Blender allows."""


def add_particle_system(
    item: bpy.types.Object, *, size: float, lifetime: float, seed: int, frame_end: int
) -> bpy.types.ParticleSystem:
    """A particle system on `item` that emits at frame 1, with a cache for the frames 1 to `frame_end`.

    Parameters
    ----------
    size
        Radius of a particle, Blender units.
    lifetime
        Of a particle, frames.
    """
    item.modifiers.new("Particles", "PARTICLE_SYSTEM")
    system = item.particle_systems[-1]
    system.seed = seed
    system.point_cache.frame_start, system.point_cache.frame_end = 1, frame_end
    settings = system.settings
    settings.display_method = "NONE"  # the fluid takes the place of Blender's dots
    settings.frame_start = settings.frame_end = 1
    settings.particle_size = size
    settings.lifetime = lifetime
    settings.normal_factor = 0.0
    return system


def make_liquid(settings: bpy.types.ParticleSettings, *, spacing: float, sound_speed: float, viscosity: float) -> None:
    """Let the particles move as a liquid, by Blender's classical SPH solver.

    Parameters
    ----------
    settings
        Of the particle system.
    spacing
        Distance of neighbouring particles at rest, Blender units.
    sound_speed
        Blender units a second; two or three times the fastest flow keeps the liquid from compressing.
    viscosity
        Artificial viscosity, dimensionless; 0.02 to 0.2.
    """
    # Blender's solver leaves out the smoothing length in the kernel's slope, and divides by the particle's mass once too
    # often. Stiffness and viscosity make up for both.
    smoothing = SMOOTHING * spacing
    settings.physics_type = "FLUID"
    settings.mass = MASS
    settings.subframes = math.ceil(settings.timestep * sound_speed / (COURANT * smoothing)) - 1
    fluid = settings.fluid
    fluid.solver = "CLASSICAL"
    fluid.use_factor_radius = fluid.use_factor_density = False
    fluid.fluid_radius = 2 * smoothing
    fluid.rest_density = MASS / spacing**3
    fluid.stiffness = sound_speed * MASS / math.sqrt(7 * smoothing * spacing**3)
    fluid.linear_viscosity = viscosity * sound_speed * MASS


def add_collision(item: bpy.types.Object, *, damping: float, friction: float) -> None:
    """Let particles bounce off `item`; both factors go from 0 (none is lost) to 1 (all is)."""
    item.modifiers.new("Collision", "COLLISION")
    item.collision.damping_factor = damping
    item.collision.friction_factor = friction


def bake(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Simulate the last particle system of `item` over the frames of its cache, which a saved .blend file then holds.

    Raises
    ------
    MeniscusError
        Blender did not bake.
    """
    cache = item.particle_systems[-1].point_cache
    with bpy.context.temp_override(scene=scene, active_object=item, point_cache=cache):
        bpy.ops.ptcache.bake(bake=True)
    if not cache.is_baked:
        raise MeniscusError(f"Blender did not bake the particles of '{item.name}'; see its messages above")
