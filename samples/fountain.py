"""Fountain: a jet of liquid rises from a nozzle, falls back into a basin, and its particles die after a while.

It stresses particles that come and go: those not yet born and those already dead are in Blender's array, but not in the fluid.
"""

from __future__ import annotations

import math

from . import scene_parts
from .one_thread import bpy
from .particle_system import add_collision, add_particle_system, bake, make_liquid

SPEED = 5.0
"""Of the jet at the nozzle, Blender units a second."""
SPREAD = 0.3
"""Random part of the velocity, which tears droplets off, Blender units a second."""
NOZZLE_RADIUS, NOZZLE_HEIGHT = 0.1, 0.5
BASIN_RADIUS, BASIN_HEIGHT, BASIN_WALL = 1.2, 0.35, 0.15
"""Blender units; the wall is far thicker than a particle moves in a step."""
LIFETIME = 55
"""Of a particle, frames."""
SOUND_SPEED = 15.0
"""Blender units a second: three times the jet's speed."""
VISCOSITY = 0.1
"""Artificial viscosity, dimensionless."""
RADIUS = 2.0
"""Influence radius, particle spacings."""


def build(scene: bpy.types.Scene, *, seed: int = 1, spacing: float = 0.05, frame_end: int = 80) -> bpy.types.Object:
    """Set up and bake the fountain.

    Parameters
    ----------
    scene
        Gets the basin, the liquid, a camera and lights.
    seed
        Of the places in the nozzle where particles are born.
    spacing
        Distance of the particles at rest, Blender units; 0.05 makes about 4,000 of them.
    frame_end
        Last frame of the simulation, 25 frames a second.

    Returns
    -------
    The object whose particle system is the liquid.
    """
    scene_parts.set_frames(scene, frame_end)
    scene.gravity = (0.0, 0.0, -9.81)
    _add_basin(scene)
    scene_parts.add_camera(scene, (0.0, -6.0, 2.8), (0.0, 0.0, 0.9), lens=45.0)
    scene_parts.add_lights(scene)
    liquid = _add_jet(scene, spacing, seed, frame_end)
    bake(scene, liquid)
    return liquid


def _add_basin(scene: bpy.types.Scene) -> None:
    """A round basin and the pedestal under the nozzle."""
    outer, inner = BASIN_RADIUS + BASIN_WALL, BASIN_RADIUS
    profile = [(0.0, 0.0), (inner, 0.0), (inner, BASIN_HEIGHT), (outer, BASIN_HEIGHT), (outer, -BASIN_WALL), (0.0, -BASIN_WALL)]
    basin = scene_parts.add_turned(scene, "Basin", profile)
    thickness = 1.3 * NOZZLE_RADIUS
    pedestal = scene_parts.add_turned(
        scene, "Pedestal", [(0.0, NOZZLE_HEIGHT - 0.05), (thickness, NOZZLE_HEIGHT - 0.05), (thickness, 0.0)]
    )
    for item in (basin, pedestal):
        scene_parts.add_surface(item, (0.6, 0.58, 0.55))
        add_collision(item, damping=0.5, friction=0.1)


def _add_jet(scene: bpy.types.Scene, spacing: float, seed: int, frame_end: int) -> bpy.types.Object:
    """A disc that emits particles upwards, as many as fill the jet at the rest density."""
    nozzle = scene_parts.add_turned(scene, "Liquid", [(0.0, NOZZLE_HEIGHT), (NOZZLE_RADIUS, NOZZLE_HEIGHT)])
    nozzle.show_instancer_for_render = False
    seconds = frame_end / scene.render.fps
    system = add_particle_system(nozzle, size=spacing / 2, lifetime=LIFETIME, seed=seed, frame_end=frame_end)
    settings = system.settings
    settings.count = round(math.pi * NOZZLE_RADIUS**2 * SPEED * seconds / spacing**3)
    settings.frame_end = frame_end
    settings.emit_from = "FACE"
    settings.object_align_factor = (0.0, 0.0, SPEED)
    settings.factor_random = SPREAD
    make_liquid(settings, spacing=spacing, sound_speed=SOUND_SPEED, viscosity=VISCOSITY)
    scene_parts.use_as_fluid(nozzle, source="PARTICLES", radius_mode="PARTICLE", radius_factor=2 * RADIUS)
    return nozzle


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
