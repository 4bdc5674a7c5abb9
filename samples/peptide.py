"""The geometry of helical peptides: atoms placed by bond lengths, bond angles and torsions, in numpy.

All lengths are in angstrom, all angles in degrees. Bond lengths and angles are those of Engh and Huber 1991, rounded; the
torsions of the alpha helix those of Arnott and Dover 1967. There are no hydrogens, as in most crystal structures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

PHI, PSI, OMEGA = -57.0, -47.0, 180.0
"""Torsions of the backbone of an alpha helix."""
BACKBONE = ("N", "CA", "C", "O", "CB")
"""Names of the atoms that every residue has; all these residues have a beta carbon."""
CHI_1, CHI_2 = (-65.0, 180.0, 65.0), (180.0, -65.0, 65.0)
"""Torsions of a side chain's first two bonds; its rotamers are all pairs of them."""


@dataclass(frozen=True)
class Bond:
    """How an atom of a side chain is placed.

    Attributes
    ----------
    atom
        Its name, which begins with its element.
    along
        Names of three atoms, the last of which it is bonded to.
    length, angle
        Of the bond, and between it and the bond before it.
    turn
        Torsion around the bond before it; from the rotamer's chi of that number where there is one.
    chi
        1 or 2, or 0 for none.
    """

    atom: str
    along: tuple[str, str, str]
    length: float
    angle: float
    turn: float
    chi: int = 0


def _gamma(atom: str, length: float, angle: float, turn: float = 0.0) -> Bond:
    return Bond(atom, ("N", "CA", "CB"), length, angle, turn, chi=1)


def _ring(heavy: float = 1.384) -> tuple[Bond, ...]:
    """Benzene on the beta carbon, square to the bond before it."""
    return (
        _gamma("CG", 1.502, 113.8),
        Bond("CD1", ("CA", "CB", "CG"), heavy, 120.7, 90.0),
        Bond("CD2", ("CA", "CB", "CG"), heavy, 120.7, -90.0),
        Bond("CE1", ("CB", "CG", "CD1"), heavy, 120.7, 180.0),
        Bond("CE2", ("CB", "CG", "CD2"), heavy, 120.7, 180.0),
        Bond("CZ", ("CG", "CD1", "CE1"), heavy, 120.0, 0.0),
    )


_CHAIN = (_gamma("CG", 1.520, 114.1), Bond("CD", ("CA", "CB", "CG"), 1.520, 111.5, 0.0, chi=2))

SIDE_CHAINS: dict[str, tuple[Bond, ...]] = {
    "ALA": (),
    "SER": (_gamma("OG", 1.417, 110.8),),
    "CYS": (_gamma("SG", 1.808, 114.0),),
    "VAL": (_gamma("CG1", 1.521, 110.5), _gamma("CG2", 1.521, 110.5, 122.0)),
    "THR": (_gamma("OG1", 1.433, 109.2), _gamma("CG2", 1.521, 111.1, -121.0)),
    "ILE": (
        _gamma("CG1", 1.530, 110.3),
        _gamma("CG2", 1.527, 110.5, -122.0),
        Bond("CD1", ("CA", "CB", "CG1"), 1.513, 113.9, 0.0, chi=2),
    ),
    "LEU": (
        _gamma("CG", 1.530, 116.3),
        Bond("CD1", ("CA", "CB", "CG"), 1.524, 110.3, 0.0, chi=2),
        Bond("CD2", ("CA", "CB", "CG"), 1.524, 110.3, 122.0, chi=2),
    ),
    "MET": (
        _gamma("CG", 1.520, 114.1),
        Bond("SD", ("CA", "CB", "CG"), 1.803, 112.7, 0.0, chi=2),
        Bond("CE", ("CB", "CG", "SD"), 1.791, 100.9, 180.0),
    ),
    "PHE": _ring(),
    "TYR": (*_ring(), Bond("OH", ("CD1", "CE1", "CZ"), 1.376, 119.9, 180.0)),
    "ASP": (
        _gamma("CG", 1.516, 112.6),
        Bond("OD1", ("CA", "CB", "CG"), 1.249, 118.4, -30.0),
        Bond("OD2", ("CA", "CB", "CG"), 1.249, 118.4, 150.0),
    ),
    "ASN": (
        _gamma("CG", 1.516, 112.6),
        Bond("OD1", ("CA", "CB", "CG"), 1.231, 120.8, -30.0),
        Bond("ND2", ("CA", "CB", "CG"), 1.328, 116.4, 150.0),
    ),
    "GLU": (
        *_CHAIN,
        Bond("OE1", ("CB", "CG", "CD"), 1.249, 118.4, 10.0),
        Bond("OE2", ("CB", "CG", "CD"), 1.249, 118.4, -170.0),
    ),
    "GLN": (
        *_CHAIN,
        Bond("OE1", ("CB", "CG", "CD"), 1.231, 120.8, 10.0),
        Bond("NE2", ("CB", "CG", "CD"), 1.328, 116.4, -170.0),
    ),
    "LYS": (
        *_CHAIN,
        Bond("CE", ("CB", "CG", "CD"), 1.520, 111.3, 180.0),
        Bond("NZ", ("CG", "CD", "CE"), 1.489, 111.9, 180.0),
    ),
    "ARG": (
        *_CHAIN,
        Bond("NE", ("CB", "CG", "CD"), 1.461, 112.0, 180.0),
        Bond("CZ", ("CG", "CD", "NE"), 1.329, 124.2, 180.0),
        Bond("NH1", ("CD", "NE", "CZ"), 1.326, 120.0, 0.0),
        Bond("NH2", ("CD", "NE", "CZ"), 1.326, 120.0, 180.0),
    ),
}
"""By the residue's name."""


def atoms_of(residue: str) -> int:
    """How many atoms a residue has inside a chain."""
    return len(BACKBONE) + len(SIDE_CHAINS[residue])


def place(along: Sequence[FloatArray], length: float, angle: float, torsion: npt.ArrayLike) -> FloatArray:
    """An atom by its bond, by the natural extension of reference frames (Parsons et al. 2005).

    Parameters
    ----------
    along
        Three atoms (..., 3); the new one is bonded to the last.
    length, angle
        Of the bond, and between it and that from the last atom to the one before.
    torsion
        (...) around that bond, 0 where the new atom is on the side of the first.

    Returns
    -------
    (..., 3) positions.
    """
    first, second, third = along
    bend, turn = np.radians(180.0 - angle), np.radians(np.asarray(torsion, np.float64))[..., None]
    forward = _unit(third - second)
    across = _unit(np.cross(second - first, forward))
    up = np.cross(across, forward)
    placed: FloatArray = third + length * (np.cos(bend) * forward + np.sin(bend) * (np.cos(turn) * up + np.sin(turn) * across))
    return placed


def helix(residues: int) -> FloatArray:
    """(residues, 5, 3) atoms of an alpha helix in the order of BACKBONE, around z and the origin; four residues at least."""
    chain: list[FloatArray] = [np.array([0.0, 0.0, 0.0]), np.array([1.458, 0.0, 0.0])]
    chain.append(chain[1] + 1.525 * np.array([-np.cos(np.radians(111.2)), np.sin(np.radians(111.2)), 0.0]))
    for _ in range(residues):
        for length, angle, torsion in ((1.329, 116.2, PSI), (1.458, 121.7, OMEGA), (1.525, 111.2, PHI)):
            chain.append(place(chain[-3:], length, angle, torsion))
    n, ca, c = np.stack(chain[: 3 * residues]).reshape(residues, 3, 3).swapaxes(0, 1)
    o = place((n, ca, c), 1.231, 120.8, PSI + 180.0)
    cb = place((c, n, ca), 1.530, 110.5, -122.6)
    return _upright(np.stack([n, ca, c, o, cb], axis=1))


def side_chains(residue: str, backbone: FloatArray) -> FloatArray:
    """All rotamers of a residue's side chain.

    Parameters
    ----------
    residue
        Its name, a key of SIDE_CHAINS.
    backbone
        (..., 5, 3) atoms in the order of BACKBONE.

    Returns
    -------
    (..., 9, atoms, 3) positions in the order of SIDE_CHAINS.
    """
    chis = np.array(np.meshgrid(CHI_1, CHI_2, indexing="ij")).reshape(2, -1)
    rotamers = (*backbone.shape[:-2], chis.shape[1], 3)
    known = {name: np.broadcast_to(backbone[..., None, at, :], rotamers) for at, name in enumerate(BACKBONE)}
    for bond in SIDE_CHAINS[residue]:
        torsion = bond.turn + (chis[bond.chi - 1] if bond.chi else 0.0)
        known[bond.atom] = place([known[name] for name in bond.along], bond.length, bond.angle, torsion)
    atoms = [known[bond.atom] for bond in SIDE_CHAINS[residue]]
    return np.stack(atoms, axis=-2) if atoms else np.zeros((*rotamers[:-1], 0, 3))


def _upright(atoms: FloatArray) -> FloatArray:
    """The atoms of a helix turned so that its axis is z and its middle is the origin."""
    # Of a helix, the second differences of equal atoms point at the axis, so two of them are square to it.
    ca = atoms[:, 1]
    inward = ca[2:] - 2 * ca[1:-1] + ca[:-2]
    axis = _unit(np.cross(inward[:-1], inward[1:]).sum(axis=0))
    side = _unit(inward[0] - (inward[0] @ axis) * axis)
    turned: FloatArray = atoms @ np.stack([side, np.cross(axis, side), axis]).T
    # The point of the axis that all alpha carbons are equally far from.
    x, y, z = turned[:, 1].T
    centre, *_ = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None)
    centred: FloatArray = turned - (centre[0], centre[1], z.mean())
    return centred


def _unit(vectors: npt.NDArray[np.floating]) -> FloatArray:
    units: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return units
