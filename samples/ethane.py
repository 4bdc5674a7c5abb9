"""Ethane: rigid pairs of Lennard-Jones sites as droplets in their vapour, as in figure 9 of Mueller, Grottel and Ertl 2007.

It stresses long lists of neighbours: in a droplet the influence sphere of a ball meets those of a hundred others, while single
molecules stay alone in the vapour. Droplets do not condense here, which takes long: they are put there as small crystals, and
a short simulation shakes them out of their order. It takes half a minute the first time.
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
from .lennard_jones import TIME_STEP, FloatArray, Gas, Simulation, forces, neighbour_pairs
from .store import source_texts, stored_file

if TYPE_CHECKING:
    import bpy

STEPS = 100
BOND = 0.67
"""Between the sites of a molecule, sigma: that of ethane."""
TEMPERATURE = 1.4
"""Epsilon by Boltzmann's constant; far below the critical one of such molecules."""
SPACING = 1.12
"""Between sites of neighbouring molecules in a crystal, sigma."""
DENSITY = 0.035
"""Sites in a cube of side sigma, of droplets and vapour together."""
DROPLETS = (0.4, 0.24, 0.14, 0.08, 0.05, 0.03, 0.02)
"""Shares of the molecules."""
SIGMA = 0.1
"""Blender units."""
RADIUS = 1.5
"""Influence radius of a site, sigma: twice the radius with which a lone one is shown."""
LEAST_MOLECULES = 200


class Dumbbells(Simulation):
    """Molecules of two sites, 2 k and 2 k + 1, at a fixed distance."""

    def step(self, temperature: float | None = None) -> None:
        """See :meth:`lennard_jones.Simulation.step`; bonds keep their length (RATTLE, Andersen 1983)."""
        gas = self.gas
        before = self._bonds()
        gas.velocities += 0.5 * TIME_STEP * self._forces
        # Where the bonds would lead, less what both sites must give along the old bond to keep its length.
        after = before + TIME_STEP * (gas.velocities[1::2] - gas.velocities[::2])
        along, length_2 = np.sum(before * after, axis=1), np.sum(after**2, axis=1)
        give = (along - np.sqrt(along**2 - BOND**2 * (length_2 - BOND**2))) / BOND**2
        push = (0.5 * give / TIME_STEP)[:, None] * before
        gas.velocities[::2] += push
        gas.velocities[1::2] -= push
        gas.positions += TIME_STEP * gas.velocities
        gas.positions %= gas.box
        moved = gas.positions - self._positions_of_pairs
        moved -= gas.box * np.rint(moved / gas.box)
        if np.max(np.einsum("ij,ij->i", moved, moved)) > (lennard_jones.SKIN / 2) ** 2:
            self._find_pairs()
        self._forces = forces(gas.positions, gas.box, self._pairs)
        gas.velocities += 0.5 * TIME_STEP * self._forces
        self.keep_bonds()
        if temperature is not None:
            # Five of six ways to move are left to a rigid molecule.
            present = gas.temperature * 6 / 5
            gas.velocities *= np.sqrt(1.0 + (temperature / present - 1.0) / lennard_jones.COUPLING_STEPS)

    def keep_bonds(self) -> None:
        """Take from the velocities what would stretch bonds."""
        bonds = self._bonds() / BOND
        stretch = np.sum((self.gas.velocities[1::2] - self.gas.velocities[::2]) * bonds, axis=1, keepdims=True)
        self.gas.velocities[::2] += 0.5 * stretch * bonds
        self.gas.velocities[1::2] -= 0.5 * stretch * bonds

    def _bonds(self) -> FloatArray:
        bonds = self.gas.positions[1::2] - self.gas.positions[::2]
        shortest: FloatArray = bonds - self.gas.box * np.rint(bonds / self.gas.box)
        return shortest

    def _find_pairs(self) -> None:
        self._positions_of_pairs = self.gas.positions.copy()
        first, second = neighbour_pairs(self.gas.positions, self.gas.box, lennard_jones.CUTOFF + lennard_jones.SKIN)
        is_between = first // 2 != second // 2
        self._pairs = first[is_between], second[is_between]


def balls(count: int = 25_000, seed: int = 1) -> Balls:
    """The sites of `count` / 2 molecules, centred in the origin; from the store where they were computed before."""
    if count < 2 * LEAST_MOLECULES or count % 2:
        raise InputError(f"Ethane has an even number of sites from {2 * LEAST_MOLECULES} on, not {count}")
    with np.load(_state_file(count, seed)) as state:
        positions = (state["positions"] - state["box"] / 2) * SIGMA
        return Balls(positions, RADIUS * SIGMA, velocities=state["velocities"] * SIGMA, ids=np.arange(count))


def build(scene: bpy.types.Scene, *, count: int = 25_000, seed: int = 1) -> bpy.types.Object:
    """Put the sites into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    sites = balls(count, seed)
    half_side = float(np.abs(sites.positions).max(initial=SIGMA))
    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, (4.6 * half_side, -6.4 * half_side, 3.2 * half_side), (0.0, 0.0, 0.0))
    scene_parts.add_lights(scene)
    return scene_parts.add_balls(scene, "Ethane", sites)


def droplets_in_vapour(molecules: int, random: np.random.Generator) -> Gas:
    """Crystals of molecules in a cube, and lone ones between them, with thermal velocities."""
    box = (2 * molecules / DENSITY) ** (1 / 3)
    inside = [_crystal(int(share * molecules), box, random) for share in DROPLETS]
    radii = [float(np.max(np.linalg.norm(sites, axis=-1))) + SPACING for sites in inside]
    middles: list[FloatArray] = []
    for radius in radii:
        middles.append(_free_place(box, radius, middles, radii, random))
    placed = [middle + sites for middle, sites in zip(middles, inside, strict=True)]
    lone = molecules - sum(len(sites) for sites in inside)
    for _ in range(lone):
        middles.append(_free_place(box, SPACING, middles, radii, random))
        radii.append(SPACING)
        placed.append(middles[-1] + 0.5 * BOND * np.array([[-1.0], [1.0]]) * _direction(random))
    positions = np.concatenate([sites.reshape(-1, 3) for sites in placed]) % box
    velocities = random.normal(0.0, np.sqrt(TEMPERATURE), positions.shape)
    return Gas(positions, velocities - velocities.mean(axis=0), box)


def _crystal(count: int, box: float, random: np.random.Generator) -> FloatArray:
    """(count, 2, 3): the molecules of a lattice nearest to the origin, all along one axis."""
    steps = np.array([SPACING, SPACING, SPACING + BOND])
    across = np.arange(-int(0.5 * box / SPACING), int(0.5 * box / SPACING) + 1)
    lattice = np.stack(np.meshgrid(across, across, across, indexing="ij"), axis=-1).reshape(-1, 3) * steps
    nearest = lattice[np.argsort(np.sum(lattice**2, axis=1), kind="stable")[:count]]
    ends = np.array([[0.0, 0.0, -0.5 * BOND], [0.0, 0.0, 0.5 * BOND]])
    turned: FloatArray = np.roll(nearest[:, None] + ends, int(random.integers(3)), axis=-1)
    return turned


def _free_place(
    box: float, radius: float, middles: list[FloatArray], radii: list[float], random: np.random.Generator
) -> FloatArray:
    """Where a sphere meets none of the others; anywhere after many tries."""
    place = random.random(3) * box
    others, reaches = np.array(middles).reshape(-1, 3), np.array(radii[: len(middles)])
    for _ in range(1000):
        apart = place - others
        apart -= box * np.rint(apart / box)
        if np.all(np.sum(apart**2, axis=1) > (reaches + radius) ** 2):
            break
        place = random.random(3) * box
    free: FloatArray = place
    return free


def _direction(random: np.random.Generator) -> FloatArray:
    direction = random.normal(size=3)
    unit: FloatArray = direction / np.linalg.norm(direction)
    return unit


def _state_file(count: int, seed: int) -> Path:
    """An .npz file with positions and velocities (count, 3) float32 in the model's units, and the box's side."""
    scripts = source_texts(sys.modules[__name__], lennard_jones)
    parameters = {"count": count, "seed": seed, "scripts": scripts}

    def make(path: Path) -> None:
        positions, velocities, box = _state(count, seed)
        np.savez_compressed(path, positions=positions, velocities=velocities, box=box)

    return stored_file("ethane", ".npz", parameters, make)


def _state(count: int, seed: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], float]:
    gas = droplets_in_vapour(count // 2, np.random.default_rng(seed))
    simulation = Dumbbells(gas)
    simulation.keep_bonds()
    for _ in range(STEPS):
        simulation.step(TEMPERATURE)
    return gas.positions.astype(np.float32), gas.velocities.astype(np.float32), gas.box


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
