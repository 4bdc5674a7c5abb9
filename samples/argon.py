"""Argon: Lennard-Jones atoms that condense from a hot gas, as in Mueller, Grottel and Ertl 2007.

It stresses what scientists look at: thousands of lone atoms between clusters of all sizes, velocities and ids, balls that
barely blend. The molecular dynamics is our own (lennard_jones.py) and takes about half a minute the first time.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..addon.fluid.balls import Balls
from ..addon.fluid.errors import InputError
from . import lennard_jones
from .lennard_jones import Simulation, hot_gas
from .store import source_texts, stored_file

if TYPE_CHECKING:
    import bpy

FRAMES = 60
STEPS_A_FRAME = 200
DENSITY = 0.05
"""Atoms in a cube of side sigma: far above that of the saturated vapour when cold."""
HOT, COLD = 1.5, 0.6
"""Temperatures at the first frame and from COOLED_FRAME on, epsilon by Boltzmann's constant; argon boils at 0.73."""
COOLED_FRAME = 20
SIGMA = 0.1
"""Blender units."""
RADIUS = 1.25
"""Influence radius of an atom, sigma: atoms in contact blend, others stay round."""
FRAMES_PER_SECOND = 25


def balls(count: int = 5000, seed: int = 1, frame: int = FRAMES) -> Balls:
    """The atoms at a frame from 1 to 60, centred in the origin; from the store where they were computed before."""
    if not 1 <= frame <= FRAMES:
        raise InputError(f"The frame must be from 1 to {FRAMES}, not {frame}")
    with np.load(_trajectory_file(count, seed)) as trajectory:
        positions = (trajectory["positions"][frame - 1] - trajectory["box"] / 2) * SIGMA
        a_second = SIGMA * lennard_jones.TIME_STEP * STEPS_A_FRAME * FRAMES_PER_SECOND
        velocities = trajectory["velocities"][frame - 1] * a_second
    return Balls(positions, RADIUS * SIGMA, velocities=velocities, ids=np.arange(count))


def build(scene: bpy.types.Scene, *, count: int = 5000, seed: int = 1, frame: int = FRAMES) -> bpy.types.Object:
    """Put the atoms of one frame into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    atoms = balls(count, seed, frame)
    half_side = float(np.abs(atoms.positions).max(initial=SIGMA))
    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, (4.6 * half_side, -6.4 * half_side, 3.2 * half_side), (0.0, 0.0, 0.0))
    scene_parts.add_lights(scene)
    return scene_parts.add_balls(scene, "Argon", atoms)


def _trajectory_file(count: int, seed: int) -> Path:
    """An .npz file with positions and velocities (FRAMES, count, 3) float32 in the model's units, and the box's side."""
    scripts = source_texts(sys.modules[__name__], lennard_jones)
    parameters = {"count": count, "seed": seed, "scripts": scripts}

    def make(path: Path) -> None:
        positions, velocities, box = _trajectory(count, seed)
        np.savez_compressed(path, positions=positions, velocities=velocities, box=box)

    return stored_file("argon", ".npz", parameters, make)


def _trajectory(count: int, seed: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], float]:
    gas = hot_gas(count, DENSITY, HOT, np.random.default_rng(seed))
    simulation = Simulation(gas)
    positions = np.empty((FRAMES, count, 3), np.float32)
    velocities = np.empty_like(positions)
    for frame in range(FRAMES):
        positions[frame], velocities[frame] = gas.positions, gas.velocities
        temperature = HOT + (COLD - HOT) * min(1.0, frame / COOLED_FRAME)
        for _ in range(STEPS_A_FRAME):
            simulation.step(temperature)
    return positions, velocities, gas.box


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
