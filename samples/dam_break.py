"""Dam break: a block of liquid collapses in a tank, hits a pillar, splashes up the far wall and comes back.

It stresses what artists do every day: Blender's own SPH particles, from a solid block through thin sheets to lone droplets,
with particle ids and velocities, read from a baked particle system.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from . import particle_system, scene_parts
from .one_thread import bpy
from .particle_system import add_collision, add_particle_system, bake, make_liquid
from .store import source_texts, stored_file

TANK = (4.0, 1.2, 2.4)
"""Length, depth and height, Blender units."""
WALL = 0.2
"""Thickness of the colliding walls: far more than a particle moves in a step."""
WATER = (1.08, 1.2, 2.16)
"""The block of liquid at the left end of the tank, Blender units."""
PILLAR_LOW, PILLAR_HIGH = (2.2, 0.45, -0.1), (2.45, 0.75, 0.9)
"""Corners of the obstacle, Blender units."""

DISORDER = 0.04
"""Of the particles at the start, spacings: breaks the symmetry of the lattice."""
SOUND_SPEED = 15.0
"""Blender units a second: more than twice the fastest flow, so that the liquid hardly compresses and steps stay long."""
VISCOSITY = 0.03
"""Artificial viscosity, dimensionless: just enough to calm the noise of the collapse."""
RADIUS = 2.0
"""Influence radius, particle spacings."""


def build(scene: bpy.types.Scene, *, seed: int = 1, spacing: float = 0.06, frame_end: int = 60) -> bpy.types.Object:
    """Set up and bake the dam break.

    Parameters
    ----------
    scene
        Gets the tank, the liquid, a camera and lights.
    seed
        Of the small disorder that the liquid starts with.
    spacing
        Distance of the particles at the start, Blender units; 0.06 makes 12,960 of them.
    frame_end
        Last frame of the simulation, 25 frames a second.

    Returns
    -------
    The object whose particle system is the liquid.
    """
    scene_parts.set_frames(scene, frame_end)
    scene.gravity = (0.0, 0.0, -9.81)
    _add_tank(scene)
    scene_parts.add_camera(scene, (4.6, -6.2, 3.2), (2.0, 0.5, 1.0), lens=42.0)
    scene_parts.add_lights(scene)
    liquid = _add_liquid(scene, spacing, seed, frame_end)
    bake(scene, liquid)
    return liquid


def baked_file(*, seed: int = 1, spacing: float = 0.06, frame_end: int = 60) -> Path:
    """A .blend file with the baked simulation, from the store where it was made before; replaces the open file if not."""
    options: dict[str, Any] = {"seed": seed, "spacing": spacing, "frame_end": frame_end}

    def make(path: Path) -> None:
        build(scene_parts.new_scene(), **options)
        scene_parts.save_blend(path)

    scripts = source_texts(sys.modules[__name__], particle_system, scene_parts)
    parameters = {**options, "blender": bpy.app.version_string, "scripts": scripts}
    return stored_file("dam_break", ".blend", parameters, make)


def _add_tank(scene: bpy.types.Scene) -> None:
    """Invisible solid walls that overlap at the edges, so that no particle slips out; a visible floor, back and pillar."""
    length, depth, height = TANK
    west, south, floor, east, north, top = -WALL, -WALL, -WALL, length + WALL, depth + WALL, 2 * height
    walls = (
        ((west, south, floor), (east, north, 0.0)),
        ((west, south, floor), (0.0, north, top)),
        ((length, south, floor), (east, north, top)),
        ((west, south, floor), (east, 0.0, top)),
        ((west, depth, floor), (east, north, top)),
    )
    for low, high in walls:
        wall = scene_parts.add_box(scene, "Wall", low, high)
        wall.display_type = "BOUNDS"
        wall.hide_render = True
        add_collision(wall, damping=0.0, friction=0.0)
    tank = scene_parts.add_box(scene, "Tank", (0.0, 0.0, 0.0), TANK, without=("front", "top"))
    scene_parts.add_surface(tank, (0.7, 0.7, 0.7))
    pillar = scene_parts.add_box(scene, "Pillar", PILLAR_LOW, PILLAR_HIGH)
    scene_parts.add_surface(pillar, (0.5, 0.35, 0.25))
    add_collision(pillar, damping=0.0, friction=0.0)


def _add_liquid(scene: bpy.types.Scene, spacing: float, seed: int, frame_end: int) -> bpy.types.Object:
    """A box that is filled with particles at frame 1, on a slightly disturbed lattice."""
    liquid = scene_parts.add_box(scene, "Liquid", (0.0, 0.0, 0.0), WATER)
    liquid.show_instancer_for_render = liquid.show_instancer_for_viewport = False
    system = add_particle_system(liquid, size=spacing / 2, lifetime=frame_end + 1, seed=seed, frame_end=frame_end)
    settings = system.settings
    # One particle from each vertex of a lattice would be simpler, but Blender puts two on some vertices and none on others.
    settings.emit_from = "VOLUME"
    settings.distribution = "GRID"
    settings.grid_resolution = round(max(WATER) / spacing)
    settings.grid_random = DISORDER
    make_liquid(settings, spacing=spacing, sound_speed=SOUND_SPEED, viscosity=VISCOSITY)
    scene_parts.use_as_fluid(liquid, source="PARTICLES", radius_mode="PARTICLE", radius_factor=2 * RADIUS)
    return liquid


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
