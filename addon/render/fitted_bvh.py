"""The fitted bounding volume hierarchy (Gourmel et al. 2010): any rays against the surface, built once, asked often."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.errors import InputError
from ..fluid.field import Field
from .native import fluid_arguments, let_interrupt, load, numbers, translated_errors

FloatArray = npt.NDArray[np.float64]

Watch = Callable[[float], object]
"""Is called with the share of the work that is done, 0 to 1, about fifty times a second; what it raises cancels."""


class FirstHits(NamedTuple):
    """Where N rays first cross the surface.

    Attributes
    ----------
    t
        (N,) float64: distance along the unit ray, Blender units; infinite where it does not cross.
    normals
        (N, 3) float32: unit, world space, out of the fluid; 0 where the ray does not cross.
    balls
        (N,) int32: index of the ball with the greatest share of the density; -1 where the ray does not cross.
    """

    t: FloatArray
    normals: npt.NDArray[np.float32]
    balls: npt.NDArray[np.int32]


class RayCounts(NamedTuple):
    """Averages over rays (Gourmel et al. 2010, table 3).

    Attributes
    ----------
    traversals
        Nodes of sixteen children whose boxes were tested.
    searches
        Leaves that were searched for the surface.
    balls
        Balls in those leaves.
    """

    traversals: float
    searches: float
    balls: float


@dataclass(frozen=True)
class TreeArrays:
    """The tree as flat arrays for a GPU, in scene coordinates: world space less `origin`.

    Attributes
    ----------
    nodes
        (M, 8) float32, two vectors of four a node in depth-first order: least corner and link, greatest corner and count. Link
        and count are the bits of unsigned integers, see docs/fitted_bvh.md.
    ids
        (K,) uint32: the balls of the leaves; 2^32 - 1 is none.
    balls
        (N, 4) float32: centres and influence radii.
    weights
        (N,) float32.
    origin
        (3,) float64, world space.
    """

    nodes: npt.NDArray[np.float32]
    ids: npt.NDArray[np.uint32]
    balls: npt.NDArray[np.float32]
    weights: npt.NDArray[np.float32]
    origin: FloatArray


class FittedBvh:
    """A tree over balls in which any rays find the surface, also incoherent ones: ambient occlusion, shadows, reflections.

    Parameters
    ----------
    balls, field
        What to cast at. Weights may be negative.
    hierarchy
        "fitted" cuts space, so that nodes never overlap; "overlapping" parts the balls, as an ordinary BVH does (Gourmel et
        al. 2010, sections 5 and 4).
    fits, tightens, discards, proves
        The refinements of the tree; they change its speed, not the surface. Shrink boxes to the balls in them (section
        5.1.2); only as far as these can make a surface (5.3.1); drop balls from leaves where they make none (5.3.2); leave out
        boxes that the surface is proven not to cross.
    threads
        0: one for each core.
    watch
        Called while the tree is built.

    Raises
    ------
    InputError
        The hierarchy is unknown.
    DeviceError
        The native core is missing, or there is too little memory.
    """

    def __init__(
        self,
        balls: Balls,
        field: Field,
        *,
        hierarchy: str = "fitted",
        fits: bool = True,
        tightens: bool = True,
        discards: bool = True,
        proves: bool = True,
        threads: int = 0,
        watch: Watch = let_interrupt,
    ) -> None:
        if hierarchy not in ("fitted", "overlapping"):
            raise InputError(f"Unknown hierarchy '{hierarchy}': choose fitted or overlapping")
        self._balls = balls
        with translated_errors():
            self._native = load().FittedBvh(
                *fluid_arguments(balls, field),
                overlapping=hierarchy == "overlapping",
                fits=fits,
                tightens=tightens,
                discards=discards,
                proves=proves,
                threads=threads,
                watch=watch,
            )

    @property
    def native(self) -> Any:
        """The tree as the core has it; it holds no balls."""
        return self._native

    @property
    def bytes(self) -> int:
        """Memory that the tree takes."""
        return int(self._native.bytes)

    def first_hit(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        *,
        threads: int = 0,
        watch: Watch = let_interrupt,
    ) -> FirstHits:
        """Find where rays first cross the surface, in either direction: a ray that begins inside sees it from within.

        Parameters
        ----------
        origins, directions
            (N, 3), world space; float64 and C-contiguous arrays are not copied. Directions need not be unit.
        t_min, t_max
            One number or (N,): the surface is looked for between these distances along the unit ray, Blender units. Whether a
            ray begins inside is asked at `t_min`.
        threads
            0: one for each core.
        watch
            Called while rays are cast.

        Raises
        ------
        InputError
            The arrays have the wrong shape, a number is not finite, or a direction is zero.
        """
        with translated_errors():
            return FirstHits(*self._native.first_hit(*_rays(origins, directions, t_min, t_max), threads=threads, watch=watch))

    def any_hit(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        *,
        threads: int = 0,
        watch: Watch = let_interrupt,
    ) -> npt.NDArray[np.bool_]:
        """Whether rays cross the surface, (N,); faster than `first_hit`, with the same arguments and errors."""
        with translated_errors():
            hits: npt.NDArray[np.bool_] = self._native.any_hit(
                *_rays(origins, directions, t_min, t_max), threads=threads, watch=watch
            )
        return hits

    def counts(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, t_min: npt.ArrayLike = 0.0, t_max: npt.ArrayLike = np.inf
    ) -> RayCounts:
        """What finding the first hits of rays takes, a ray; the same arguments and errors as for `first_hit`."""
        rays = _rays(origins, directions, t_min, t_max)
        with translated_errors():
            sums = self._native.count(*rays, watch=let_interrupt)
        return RayCounts(*(total / max(len(rays[0]), 1) for total in sums))

    def arrays(self) -> TreeArrays:
        """The tree for a GPU."""
        nodes, ids, origin = self._native.arrays()
        scene_origin = np.array(origin)
        centers = (self._balls.positions - scene_origin).astype(np.float32)
        records = np.column_stack([centers, self._balls.radii])
        return TreeArrays(nodes, ids, np.ascontiguousarray(records), self._balls.weights, scene_origin)


def _rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike, t_min: npt.ArrayLike, t_max: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The arguments of native calls."""
    return (
        numbers("origins", origins),
        numbers("directions", directions),
        np.atleast_1d(numbers("t_min", t_min)),
        np.atleast_1d(numbers("t_max", t_max)),
    )
