"""Molecular dynamics of Lennard-Jones atoms in a periodic cube, in numpy.

All quantities are in the model's own units: lengths in sigma, energies in epsilon, masses in that of an atom, temperatures in
epsilon by Boltzmann's constant. For argon the unit of length is 0.34 nm, that of time 2.2 ps, that of temperature 120 K.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..addon.fluid.errors import InputError

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

CUTOFF = 2.5
"""Distance beyond which atoms do not feel each other."""
SKIN = 0.6
"""Pairs are kept up to the cut-off plus this, so that they serve many steps."""
TIME_STEP = 0.005
COUPLING_STEPS = 20
"""Steps in which the thermostat takes up the difference in temperature."""

# Half of the 26 neighbours of a cell: each pair of cells is met once.
_HALF_NEIGHBOURS = np.array([(x, y, z) for z in (0, 1) for y in (-1, 0, 1) for x in (-1, 0, 1) if (z, y, x) > (0, 0, 0)])


@dataclass
class Gas:
    """The state of the atoms.

    Attributes
    ----------
    positions, velocities
        (N, 3) float64; positions lie in the cube from 0 to `box`.
    box
        Side of the periodic cube.
    """

    positions: FloatArray
    velocities: FloatArray
    box: float

    @property
    def temperature(self) -> float:
        """Two thirds of the mean kinetic energy."""
        return float(np.mean(self.velocities**2))


def hot_gas(count: int, density: float, temperature: float, random: np.random.Generator) -> Gas:
    """`count` atoms on a lattice in a cube of the given number density, with thermal velocities and no drift."""
    box = (count / density) ** (1 / 3)
    sites = int(np.ceil(count ** (1 / 3) - 1e-9))
    # Sites are drawn from the whole lattice, so that the gas has no empty corner.
    chosen = np.sort(random.permutation(sites**3)[:count])
    positions = (np.stack(np.unravel_index(chosen, (sites,) * 3), axis=1) + 0.5) * (box / sites)
    velocities = random.normal(0.0, np.sqrt(temperature), (count, 3))
    return Gas(positions, velocities - velocities.mean(axis=0), box)


def neighbour_pairs(positions: FloatArray, box: float, reach: float) -> tuple[IndexArray, IndexArray]:
    """All pairs of atoms closer than `reach`, each once, by a cell list.

    Parameters
    ----------
    positions
        (N, 3) in the periodic cube from 0 to `box`.
    reach
        At most a third of `box`.

    Returns
    -------
    first, second : (P,) indices.

    Raises
    ------
    InputError
        The box is too narrow.
    """
    cells = int(box // reach)
    if cells < 3:
        raise InputError(
            f"The box ({box:.3g}) must be at least three times as wide as atoms reach ({reach:.3g}); take more atoms"
        )
    cell_of = np.minimum((positions * (cells / box)).astype(np.int64), cells - 1)
    flat = _flat_cells(cell_of, cells)
    order = np.argsort(flat, kind="stable")
    starts = np.searchsorted(flat[order], np.arange(cells**3 + 1))
    # In its own cell an atom is paired with those that come later in the order, in half of the cells around with all.
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    around = _flat_cells((cell_of[:, None] + _HALF_NEIGHBOURS) % cells, cells)
    range_starts = np.column_stack([rank + 1, starts[around]]).ravel()
    range_ends = np.column_stack([starts[flat + 1], starts[around + 1]]).ravel()
    first = np.repeat(np.arange(len(positions)), len(_HALF_NEIGHBOURS) + 1)
    which, member = _expanded_ranges(range_starts, range_ends)
    first, second = first[which], order[member]
    separations = _nearest_image(positions[second] - positions[first], box)
    near = np.einsum("ij,ij->i", separations, separations) < reach * reach
    return first[near], second[near]


def forces(positions: FloatArray, box: float, pairs: tuple[IndexArray, IndexArray]) -> FloatArray:
    """(N, 3) forces on the atoms from the `pairs` closer than the cut-off."""
    first, second = pairs
    separations = _nearest_image(positions[second] - positions[first], box)
    inverse_square = 1.0 / np.einsum("ij,ij->i", separations, separations)
    inverse_sixth = np.where(inverse_square > CUTOFF**-2, inverse_square**3, 0.0)
    pushes = (-24.0 * inverse_square * inverse_sixth * (2.0 * inverse_sixth - 1.0))[:, None] * separations
    count = len(positions)
    columns = [np.bincount(first, pushes[:, axis], count) - np.bincount(second, pushes[:, axis], count) for axis in range(3)]
    return np.stack(columns, axis=1)


class Simulation:
    """Velocity Verlet integration of a gas with a thermostat that rescales velocities gently."""

    def __init__(self, gas: Gas) -> None:
        self.gas = gas
        self._find_pairs()
        self._forces = forces(gas.positions, gas.box, self._pairs)

    def step(self, temperature: float | None = None) -> None:
        """Advance by TIME_STEP; `temperature` is what the thermostat steers to, None for none."""
        gas = self.gas
        gas.velocities += 0.5 * TIME_STEP * self._forces
        gas.positions += TIME_STEP * gas.velocities
        gas.positions %= gas.box
        moved = _nearest_image(gas.positions - self._positions_of_pairs, gas.box)
        if np.max(np.einsum("ij,ij->i", moved, moved)) > (SKIN / 2) ** 2:
            self._find_pairs()
        self._forces = forces(gas.positions, gas.box, self._pairs)
        gas.velocities += 0.5 * TIME_STEP * self._forces
        if temperature is not None:
            gas.velocities *= np.sqrt(1.0 + (temperature / gas.temperature - 1.0) / COUPLING_STEPS)

    def potential_energy(self) -> float:
        """Of all pairs, shifted so that it is zero at the cut-off."""
        first, second = self._pairs
        separations = _nearest_image(self.gas.positions[second] - self.gas.positions[first], self.gas.box)
        inverse_sixth = np.einsum("ij,ij->i", separations, separations) ** -3
        energies = 4.0 * (inverse_sixth**2 - inverse_sixth) - 4.0 * (CUTOFF**-12 - CUTOFF**-6)
        return float(np.sum(energies[inverse_sixth > CUTOFF**-6]))

    def _find_pairs(self) -> None:
        self._positions_of_pairs = self.gas.positions.copy()
        self._pairs = neighbour_pairs(self.gas.positions, self.gas.box, CUTOFF + SKIN)


def _flat_cells(cells_xyz: IndexArray, cells: int) -> IndexArray:
    return (cells_xyz[..., 0] * cells + cells_xyz[..., 1]) * cells + cells_xyz[..., 2]


def _nearest_image(separations: FloatArray, box: float) -> FloatArray:
    images: FloatArray = np.rint(separations / box)
    return separations - box * images


def _expanded_ranges(starts: IndexArray, ends: IndexArray) -> tuple[IndexArray, IndexArray]:
    """For every integer in every range: the range's index, and the integer."""
    lengths = ends - starts
    which = np.repeat(np.arange(len(starts)), lengths)
    offsets = np.arange(len(which)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    return which, starts[which] + offsets
