"""Dam break: a block of liquid collapses in a tank, hits a pillar, splashes up the far wall and comes back.

It stresses what artists do every day: Blender's own SPH particles, from a solid block through thin sheets to lone droplets,
with particle ids and velocities, read from a baked particle system.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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
    liquid = _add_liquid(scene, _start_positions(spacing, seed), spacing, seed, frame_end)
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
    outer_low, outer_high = (-WALL, -WALL, -WALL), (length + WALL, depth + WALL, 2 * height)
    for axis in range(3):
        for is_high in (False, True) if axis < 2 else (False,):
            low, high = list(outer_low), list(outer_high)
            low[axis], high[axis] = (TANK[axis], outer_high[axis]) if is_high else (outer_low[axis], 0.0)
            wall = scene_parts.add_box(scene, "Wall", tuple(low), tuple(high))
            wall.display_type = "BOUNDS"
            wall.hide_render = True
            add_collision(wall, damping=0.0, friction=0.0)
    tank = scene_parts.add_box(scene, "Tank", (0.0, 0.0, 0.0), TANK, without=("front", "top"))
    scene_parts.add_surface(tank, (0.7, 0.7, 0.7))
    pillar = scene_parts.add_box(scene, "Pillar", PILLAR_LOW, PILLAR_HIGH)
    scene_parts.add_surface(pillar, (0.5, 0.35, 0.25))
    add_collision(pillar, damping=0.0, friction=0.0)


def _start_positions(spacing: float, seed: int) -> npt.NDArray[np.float32]:
    """(N, 3): a lattice that fills the block of water, slightly disturbed."""
    axes = [(np.arange(round(side / spacing)) + 0.5) * spacing for side in WATER]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    disorder = np.random.default_rng(seed).uniform(-0.02, 0.02, lattice.shape) * spacing
    return (lattice + disorder).astype(np.float32)


def _add_liquid(
    scene: bpy.types.Scene, positions: npt.NDArray[np.float32], spacing: float, seed: int, frame_end: int
) -> bpy.types.Object:
    """An object that emits one particle from each vertex at frame 1, still and in order."""
    liquid = scene_parts.add_points(scene, "Liquid", positions, {})
    liquid.show_instancer_for_render = False
    system = add_particle_system(
        liquid, count=len(positions), size=spacing / 2, lifetime=frame_end + 1, seed=seed, frame_end=frame_end
    )
    settings = system.settings
    settings.emit_from = "VERT"
    settings.use_emit_random = False
    make_liquid(settings, spacing=spacing, sound_speed=SOUND_SPEED, viscosity=VISCOSITY)
    scene_parts.use_as_fluid(liquid, source="PARTICLES", radius_mode="PARTICLE", radius_factor=2 * RADIUS)
    return liquid


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
