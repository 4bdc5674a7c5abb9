"""Molecule: a bundle of thirteen protein helices with 2,878 atoms, as many as in Kanamori, Szego and Nishita 2008, figure 11.

It stresses what chemists look at: balls of several sizes and colours that touch along bonds and must not melt into one lump.
The protein is a designed one: ideal helices (peptide.py), greasy residues inside, watery ones outside, side chains turned
so that they get out of each other's way. Colours and van der Waals radii go by element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..addon.fluid.balls import Balls
from . import peptide
from .peptide import FloatArray

if TYPE_CHECKING:
    import bpy

ATOMS = 2878
HELICES, RESIDUES = 13, 28
"""How many helices, and how many residues each."""
SPACING = 11.0
"""Of the axes of neighbouring helices, angstrom; they stand on a triangular lattice."""
TILT = 0.9
"""Of a helix, degrees for each angstrom between it and the bundle's axis."""
BURIED_RADIUS = 15.5
"""Distance of a beta carbon from the bundle's axis, angstrom, up to which its residue is greasy."""
BURIED = {"LEU": 0.30, "ALA": 0.17, "VAL": 0.22, "ILE": 0.13, "PHE": 0.09, "MET": 0.06, "CYS": 0.03}
EXPOSED = {"GLU": 0.20, "LYS": 0.18, "ARG": 0.10, "GLN": 0.12, "ASP": 0.07, "ASN": 0.07, "SER": 0.10, "THR": 0.08}
EXPOSED |= {"VAL": 0.04, "LEU": 0.04}
"""How often residues occur."""

RADII = {"C": 1.70, "N": 1.55, "O": 1.52, "S": 1.80}
"""Van der Waals radii, angstrom (Bondi 1964)."""
COLORS = {"C": (0.30, 0.32, 0.34), "N": (0.06, 0.13, 0.70), "O": (0.70, 0.05, 0.04), "S": (0.75, 0.55, 0.04)}
"""After Corey, Pauling and Koltun, linear Rec.709."""
RADIUS, ISOVALUE = 0.8, 0.6
"""Influence radius, van der Waals radii, and T of Wyvill's kernel. An atom alone then has a third of its van der Waals radius:
those that are bonded would not touch as spheres, and blend along their bonds as metaballs."""
UNIT = 0.1
"""Blender units in an angstrom."""
EYE = (7.5, -11.0, 2.6)
"""From where the whole molecule is seen, Blender units."""


@dataclass(frozen=True)
class Molecule:
    """Atoms in angstrom, the bundle's axis along z and its middle in the origin.

    Attributes
    ----------
    positions
        (N, 3) float64.
    elements
        (N,) of "C", "N", "O" and "S".
    residues
        (N,) the residue of each atom, counted through all helices.
    """

    positions: FloatArray
    elements: npt.NDArray[np.str_]
    residues: npt.NDArray[np.int64]


def balls(seed: int = 1) -> Balls:
    """The atoms, the same for the same seed, which draws the sequence."""
    molecule = protein(seed)
    elements, which = np.unique(molecule.elements, return_inverse=True)
    radii = np.array([RADII[element] for element in elements])[which] * RADIUS * UNIT
    colors = np.array([COLORS[element] for element in elements])[which]
    return Balls(molecule.positions * UNIT, radii, colors=colors, ids=np.arange(len(radii)))


def build(scene: bpy.types.Scene, *, seed: int = 1) -> bpy.types.Object:
    """Put the atoms into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, EYE, (0.0, 0.0, 0.0), lens=42.0)
    scene_parts.add_lights(scene)
    scene_parts.use_field(scene, isovalue=ISOVALUE)
    return scene_parts.add_balls(scene, "Molecule", balls(seed))


@cache
def protein(seed: int = 1) -> Molecule:
    """The whole bundle."""
    random = np.random.default_rng(seed)
    backbone = _bundle(random)
    return _with_side_chains(backbone, _sequence(backbone, random))


def _bundle(random: np.random.Generator) -> FloatArray:
    """(HELICES * RESIDUES, 5, 3) backbones; every other helix runs downwards, and all lean around the bundle's axis."""
    axes = _lattice()
    atoms = np.broadcast_to(peptide.helix(RESIDUES), (HELICES, RESIDUES, 5, 3))
    around, upside_down = random.uniform(0, 2 * np.pi, HELICES), np.arange(HELICES) % 2 * np.pi
    lean = np.radians(TILT) * np.hypot(*axes.T)
    bearing = np.arctan2(axes[:, 1], axes[:, 0])
    shift = np.column_stack([axes, random.uniform(-3, 3, HELICES)])
    # Turned around its own axis and maybe over, then leant about the line from the bundle's axis to it.
    turn = _about(2, bearing) @ _about(0, lean + upside_down) @ _about(2, around - bearing)
    placed: FloatArray = np.einsum("hij,hraj->hrai", turn, atoms) + shift[:, None, None]
    return placed.reshape(-1, 5, 3)


def _lattice() -> FloatArray:
    """(HELICES, 2) points of a triangular lattice, the nearest to the origin."""
    i, j = np.mgrid[-3:4, -3:4].reshape(2, -1)
    points = SPACING * np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=1)
    return points[np.argsort(np.hypot(*points.T), kind="stable")[:HELICES]]


def _about(axis: int, angles: FloatArray) -> FloatArray:
    """(N, 3, 3) rotations about the x (0) or z (2) axis."""
    cosine, sine = np.cos(angles), np.sin(angles)
    rotations = np.zeros((len(angles), 3, 3))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotations[:, axis, axis] = 1.0
    rotations[:, first, first] = rotations[:, second, second] = cosine
    rotations[:, second, first], rotations[:, first, second] = sine, -sine
    return rotations


def _sequence(backbone: FloatArray, random: np.random.Generator) -> npt.NDArray[np.str_]:
    """The residues' names, with ATOMS atoms in all; each helix ends with one oxygen more."""
    is_buried = np.hypot(*backbone[:, peptide.BACKBONE.index("CB"), :2].T) < BURIED_RADIUS
    sizes = {name: peptide.atoms_of(name) for name in peptide.SIDE_CHAINS}
    while True:
        names = np.where(is_buried, _drawn(BURIED, len(backbone), random), _drawn(EXPOSED, len(backbone), random))
        missing = ATOMS - HELICES - sum(sizes[name] for name in names.tolist())
        # Valine and leucine differ by one atom.
        (old, new) = ("VAL", "LEU") if missing > 0 else ("LEU", "VAL")
        replaceable = random.permutation(np.flatnonzero(names == old))
        if len(replaceable) >= abs(missing):
            names[replaceable[: abs(missing)]] = new
            return names


def _drawn(shares: dict[str, float], count: int, random: np.random.Generator) -> npt.NDArray[np.str_]:
    names: npt.NDArray[np.str_] = random.choice(list(shares), count, p=list(shares.values()))
    return names


def _with_side_chains(backbone: FloatArray, names: npt.NDArray[np.str_]) -> Molecule:
    """Residue by residue, the rotamer that is farthest from all that is there."""
    n, ca, c = (backbone[RESIDUES - 1 :: RESIDUES, peptide.BACKBONE.index(name)] for name in ("N", "CA", "C"))
    ends = peptide.place((n, ca, c), 1.249, 117.0, peptide.PSI)
    there = np.empty((ATOMS, 3))
    elements = np.empty(ATOMS, "U1")
    residues = np.empty(ATOMS, np.int64)
    count = 0

    def add(atoms: FloatArray, of_elements: list[str], of_residues: npt.ArrayLike) -> None:
        nonlocal count
        added = slice(count, count + len(atoms))
        there[added], elements[added], residues[added] = atoms, of_elements, of_residues
        count += len(atoms)

    number = np.arange(len(backbone))
    add(backbone.reshape(-1, 3), [name[0] for name in peptide.BACKBONE] * len(backbone), np.repeat(number, 5))
    add(ends, ["O"] * HELICES, number[RESIDUES - 1 :: RESIDUES])
    for residue, name in enumerate(names.tolist()):
        rotamers = peptide.side_chains(name, backbone[residue])
        others = there[:count][residues[:count] != residue]
        best = np.argmax(_clearances(rotamers, others))
        add(rotamers[best], [bond.atom[0] for bond in peptide.SIDE_CHAINS[name]], residue)
    return Molecule(there, elements, residues)


def _clearances(rotamers: FloatArray, others: FloatArray) -> FloatArray:
    """(9,) how far the nearest of `others` is from each rotamer's atoms, squared."""
    distance_2 = ((rotamers[..., None, :] - others) ** 2).sum(axis=-1)
    nearest: FloatArray = distance_2.min(axis=-1).min(axis=-1, initial=np.inf)
    return nearest


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
