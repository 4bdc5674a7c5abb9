"""Balls that are too many for the buffers, in slabs from near to far: shells around the eye, or slices of a parallel view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ....addon.fluid.balls import Balls
from ....addon.fluid.camera import Camera
from ....addon.fluid.errors import DeviceError

FAR = 3e38
"""Beyond everything, as in lists.glsl."""

_MARGIN = 1e-5
"""Share of a distance by which a ball may begin or end elsewhere than single precision says."""


@dataclass(frozen=True)
class Slab:
    """A part of all rays, and the balls that reach into it.

    Attributes
    ----------
    start, end
        Distances along each ray.
    balls
        All that a ray may meet between.
    indices
        Which of all balls these are; None for all.
    is_first
        Whether no slab was searched before.
    """

    start: float
    end: float
    balls: Balls
    indices: npt.NDArray[np.int64] | None = None
    is_first: bool = True


def slabs(balls: Balls, camera: Camera, most: int) -> Iterator[Slab]:
    """All balls that may be seen in slabs of at most `most`; none where there is none.

    Raises
    ------
    DeviceError
        More balls than that overlap.
    """
    near, far = _reaches(balls, camera)
    seen = np.flatnonzero((far > camera.clip_start) & np.isfinite(near))
    near, far = near[seen], far[seen]
    begins, ends = np.sort(near), np.sort(far)
    start = -FAR
    is_first = True
    while start < FAR and len(seen):
        ended = int(np.searchsorted(ends, start, side="right"))
        end = float(begins[ended + most]) if ended + most < len(begins) else FAR
        inside = np.flatnonzero((near <= start if end <= start else near < end) & (far > start))
        if end <= start:
            raise DeviceError(
                f"{len(inside):,} balls overlap at one distance but the graphics processor takes at most {most:,} at once; "
                "use the CPU back-end, or smaller radii"
            )
        if len(inside):
            indices = seen[inside]
            yield Slab(start, end, _chosen(balls, indices), indices, is_first)
            is_first = False
        start = end


def _reaches(balls: Balls, camera: Camera) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(N,) distances at which any ray may first meet each ball, and may leave it last."""
    offsets = balls.positions - camera.eye
    if camera.is_perspective:
        middle = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    else:
        middle = -(offsets @ camera.world_from_view[:3, 2])
    margin = _MARGIN * (np.abs(middle) + balls.radii)
    return middle - balls.radii - margin, middle + balls.radii + margin


def _chosen(balls: Balls, indices: npt.NDArray[np.int64]) -> Balls:
    def of(values: npt.NDArray[np.float32] | None) -> npt.NDArray[np.float32] | None:
        return None if values is None else values[indices]

    return Balls(balls.positions[indices], balls.radii[indices], balls.weights[indices], of(balls.colors), of(balls.velocities))
