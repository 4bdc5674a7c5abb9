"""Spheres and ellipsoids in the place of metaballs (Mueller, Grottel and Ertl 2007, figure 1).

A ball is shown as its kernel sphere, a connected liquid as the solid ellipsoid that has the centre of mass and the second
moments of the solid kernel spheres of its balls. What was made of some balls is kept as long as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.field import Field
from ..fluid.view_balls import meets_view
from .cluster_numbers import number_clusters
from .method import Request

Doubles = npt.NDArray[np.float64]
FloatArray = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Glyphs:
    """G spheres or ellipsoids with hard surfaces.

    Attributes
    ----------
    centers
        (G, 3) float32, world space, Blender units.
    extents
        (G,) float32 radii of spheres, or (G, 9) the three semi-axes of ellipsoids one after the other, at right angles, world
        space, Blender units.
    balls
        (G,) int32: index of the ball that stands for each.
    colors, velocities
        (G, 3) float32 as :class:`balls.Balls` has them; None where the balls have none.
    without_surface
        How many balls have no kernel sphere, and so no share in the glyphs.
    """

    centers: FloatArray
    extents: FloatArray
    balls: Indices
    colors: FloatArray | None
    velocities: FloatArray | None
    without_surface: int

    def __len__(self) -> int:
        return len(self.centers)

    @property
    def are_spheres(self) -> bool:
        """Whether all are spheres."""
        return self.extents.ndim == 1

    @property
    def reaches(self) -> FloatArray:
        """(G,): radii of spheres around the glyphs."""
        return self.extents if self.are_spheres else np.sqrt(np.square(self.extents).reshape(-1, 3, 3).sum(axis=2).max(axis=1))


@dataclass(frozen=True, eq=False)
class ViewGlyphs:
    """The M glyphs that may be in a view.

    Attributes
    ----------
    glyphs
        What they are of.
    chosen
        (M,) int64: their indices.
    centers
        (M, 3) float64, view space.
    axes
        (M, 3, 3) float64: the semi-axes of ellipsoids, view space; None for spheres.
    """

    glyphs: Glyphs
    chosen: npt.NDArray[np.int64]
    centers: Doubles
    axes: Doubles | None

    def __len__(self) -> int:
        return len(self.chosen)


_known: WeakKeyDictionary[Balls, tuple[Field, str, Glyphs]] = WeakKeyDictionary()


def glyphs_of(request: Request) -> Glyphs:
    """What is shown in the place of the balls of a request."""
    balls, field, display = request.balls, request.field, request.display
    known = _known.get(balls)
    if known is None or known[:2] != (field, display):
        made = sphere_glyphs(balls, field) if display == "spheres" else ellipsoid_glyphs(balls, field, *_numbers(request))
        known = _known[balls] = field, display, made
    return known[2]


def _numbers(request: Request) -> tuple[Indices, int]:
    found = number_clusters(request.balls, request.field, threads=request.threads, watch=request.watch)
    return found.numbers, len(found.sizes)


def in_view(glyphs: Glyphs, camera: Camera) -> ViewGlyphs:
    """Move glyphs into view space and keep those that may meet the view between its clip distances."""
    rotation = camera.world_from_view[:3, :3]
    # In rows, see view_balls; in double precision, because only the subtraction of the eye makes coordinates small.
    centers = (rotation.T @ (glyphs.centers.T - camera.eye[:, None])).T
    chosen = np.flatnonzero(meets_view(centers, glyphs.reaches.astype(np.float64), camera))
    axes = None if glyphs.are_spheres else glyphs.extents[chosen].astype(np.float64).reshape(-1, 3, 3) @ rotation
    return ViewGlyphs(glyphs, chosen, centers[chosen], axes)


def sphere_glyphs(balls: Balls, field: Field) -> Glyphs:
    """The kernel sphere of each ball that has one."""
    radii = field.kernel_radii(balls.radii, balls.weights).astype(np.float32)
    kept = np.flatnonzero(radii > 0)
    return Glyphs(
        np.ascontiguousarray(balls.positions[kept]),
        radii[kept],
        kept.astype(np.int32),
        None if balls.colors is None else balls.colors[kept],
        None if balls.velocities is None else balls.velocities[kept],
        len(balls) - len(kept),
    )


def ellipsoid_glyphs(balls: Balls, field: Field, numbers: Indices, count: int) -> Glyphs:
    """An ellipsoid for each liquid: exactly the kernel sphere where that is a single ball.

    Parameters
    ----------
    numbers, count
        (N,) int32: the liquid of each ball, 1 to `count`, or 0 for none.

    Returns
    -------
    Glyphs in the order of the liquids, without those whose balls all have no kernel sphere.

    With the masses ``m_i = r_i^3`` of solid kernel spheres, the second moments about the centre of mass are
    ``C = sum m_i (d_i d_i^T + r_i^2 / 5) / sum m_i``, where ``d_i`` goes from there to a ball. A solid ellipsoid with the
    semi-axes ``a`` has ``a^2 / 5`` along each, so that ``a = sqrt(5 lambda)`` with the eigenvalues of C. As ``lambda`` is at
    least the mean of ``r_i^2 / 5``, none is ever flat. Colours and velocities are means by mass. The ball that stands for a
    liquid is the heaviest of the object that has most of its mass.
    """
    radii = field.kernel_radii(balls.radii, balls.weights)
    members = np.flatnonzero((numbers > 0) & (radii > 0))
    sums = _SumsByLiquid(numbers[members] - 1, count)
    # Masses by the heaviest, so that no power leaves the range of numbers.
    masses = (radii[members] / radii.max(initial=1e-300)) ** 3
    totals = sums.of(masses)
    shown = totals > 0
    safe = np.where(shown, totals, 1.0)
    # From the first ball of each: squares of coordinates far from the origin would leave nothing of their differences.
    anchors = sums.first(balls.positions[members].astype(np.float64))
    offsets = balls.positions[members] - anchors[sums.liquids]
    means = sums.of(masses[:, None] * offsets) / safe[:, None]
    offsets -= means[sums.liquids]
    moments = (masses[:, None, None] * offsets[:, :, None] * offsets[:, None, :]).reshape(-1, 9)
    own = sums.of(masses * radii[members] ** 2 / 5)[shown, None] / totals[shown, None]
    spread, vectors = np.linalg.eigh(sums.of(moments).reshape(-1, 3, 3)[shown] / totals[shown, None, None])
    # What balls are apart adds to their own moments, which are the same along all axes; rounding must not take it away.
    axes = np.sqrt(5 * (np.maximum(spread, 0) + own))[:, :, None] * vectors.transpose(0, 2, 1)

    def mean(values: FloatArray | None) -> FloatArray | None:
        if values is None:
            return None
        return (sums.of(masses[:, None] * values[members])[shown] / totals[shown, None]).astype(np.float32)

    return Glyphs(
        (anchors + means)[shown].astype(np.float32),
        np.ascontiguousarray(axes.reshape(-1, 9), np.float32),
        members[sums.heaviest(masses, None if balls.sources is None else balls.sources[members])][shown].astype(np.int32),
        mean(balls.colors),
        mean(balls.velocities),
        int(np.count_nonzero(radii <= 0)),
    )


class _SumsByLiquid:
    """Sums over the members of each liquid.

    Parameters
    ----------
    liquids
        (M,): the liquid of each member, 0 to `count` - 1.
    """

    def __init__(self, liquids: Indices, count: int) -> None:
        self.liquids, self._count = liquids, count

    def of(self, values: Doubles) -> Doubles:
        """(count,) or (count, C): the sums of (M,) or (M, C)."""
        if values.ndim == 1:
            return np.asarray(np.bincount(self.liquids, values, self._count), np.float64)
        return np.stack([np.bincount(self.liquids, column, self._count) for column in values.T], axis=1)

    def first(self, values: Doubles) -> Doubles:
        """(count, C): the row of (M, C) that is each liquid's first; 0 where it has none."""
        found = np.zeros((self._count, values.shape[1]))
        # Of several assignments to one place the last holds.
        found[self.liquids[::-1]] = values[::-1]
        return found

    def heaviest(self, masses: Doubles, sources: Indices | None) -> npt.NDArray[np.int64]:
        """(count,): the place of the heaviest member of the source with most of the mass, the first of equals; 0 for none."""
        own = np.zeros(len(masses)) if sources is None else self._shares_of_sources(masses, sources)
        order = np.lexsort((-np.arange(len(masses)), masses, own))
        found = np.zeros(self._count, np.int64)
        found[self.liquids[order]] = order
        return found

    def _shares_of_sources(self, masses: Doubles, sources: Indices) -> Doubles:
        """(M,): the mass in its liquid of what comes from the same source as each member."""
        _, group = np.unique(np.stack([self.liquids, sources], axis=1), axis=0, return_inverse=True)
        group = group.reshape(-1)
        return np.asarray(np.bincount(group, masses), np.float64)[group]
