"""The parts of rays that lie in the fluid: for its thickness, and for deep images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.field import Field
from .fitted_bvh import FittedBvh, Watch
from .native import let_interrupt
from .vector_math import FloatArray

_STEP, _LONGEST_STEP = 1e-4, 1e-2
"""How far behind a crossing the next one is looked for, in radii, by its cosine to the normal; less counts as touched."""


@dataclass(frozen=True)
class Spans:
    """Where rays are in the fluid, in order of pixel and depth.

    Attributes
    ----------
    shape
        (height, width) of the camera's region.
    pixel
        (count,) int64: row * width + column, row 0 at the bottom.
    enter, leave
        (count,) float64: planar depths, within the camera's clip distances; no two spans of a pixel overlap.
    length
        (count,) float64: along the ray, Blender units.
    normal
        (count, 3) float32: where the ray enters; unit, world space, 0 where it starts in the fluid.
    """

    shape: tuple[int, int]
    pixel: npt.NDArray[np.int64]
    enter: npt.NDArray[np.float64]
    leave: npt.NDArray[np.float64]
    length: npt.NDArray[np.float64]
    normal: FloatArray

    def __len__(self) -> int:
        return len(self.pixel)

    @property
    def thickness(self) -> FloatArray:
        """(height, width): the length of each ray in the fluid, Blender units."""
        total = np.bincount(self.pixel, self.length, self.shape[0] * self.shape[1])
        return total.reshape(self.shape).astype(np.float32)

    def before(self, depth: FloatArray) -> Spans:
        """The parts nearer than planar depths (height, width)."""
        limit = depth.reshape(-1)[self.pixel].astype(np.float64)
        kept = self.enter < limit
        leave = np.minimum(self.leave, limit)
        part = (leave - self.enter) / np.where(self.leave > self.enter, self.leave - self.enter, 1)
        return Spans(
            self.shape,
            self.pixel[kept],
            self.enter[kept],
            leave[kept],
            (self.length * part)[kept],
            self.normal[kept],
        )


def find_spans(balls: Balls, camera: Camera, field: Field, threads: int = 0, watch: Watch = let_interrupt) -> Spans:
    """Find all spans of the rays through the centres of a camera's pixels.

    From each crossing the next one is looked for, so that the time goes with the crossings, not with the balls.

    Parameters
    ----------
    balls, camera, field
        What is seen, from where, and which isosurface of it.
    threads, watch
        See :class:`fitted_bvh.FittedBvh`.

    Raises
    ------
    DeviceError
        The native core is missing, or there is too little memory.
    """
    return _Search(balls, camera, field, threads, watch).spans()


class _Search:
    def __init__(self, balls: Balls, camera: Camera, field: Field, threads: int, watch: Watch) -> None:
        self._camera, self._threads, self._watch = camera, threads, watch
        self._tree = FittedBvh(balls, field, threads=threads, watch=watch)
        self._radius = float(balls.radii.min()) if len(balls) else 1.0
        origins, directions = camera.view_rays()
        turn = camera.world_from_view[:3, :3]
        self._origins = np.ascontiguousarray(origins.reshape(-1, 3) @ turn.T + camera.eye)
        directions = directions.reshape(-1, 3) @ turn.T
        self._scale = np.linalg.norm(directions, axis=1)  # from planar depth to length
        self._directions = np.ascontiguousarray(directions / self._scale[:, None])
        count = len(directions)
        self._enter = camera.clip_start * self._scale
        self._normal = np.zeros((count, 3), np.float32)
        self._found: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64], FloatArray]] = []

    def spans(self) -> Spans:
        start, end = self._enter.copy(), self._camera.clip_end * self._scale
        pending: npt.NDArray[np.int64] = np.arange(len(start))
        self._is_inside = self._starts_inside(start)
        while len(pending):
            pending = self._advance(pending, start, end)
        return self._joined()

    def _starts_inside(self, start: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Whether rays are in the fluid at distances: there they next leave it, wherever that is."""
        hits = self._tree.first_hit(self._origins, self._directions, start, threads=self._threads, watch=self._watch)
        return np.asarray(np.isfinite(hits.t) & (np.einsum("ij,ij->i", hits.normals, self._directions) > 0))

    def _advance(
        self, pending: npt.NDArray[np.int64], start: npt.NDArray[np.float64], end: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.int64]:
        """Take one more crossing of each ray behind `start`, which moves on; the rays that may have more to come."""
        origins, directions = self._origins[pending], self._directions[pending]
        hits = self._tree.first_hit(origins, directions, start[pending], end[pending], threads=self._threads, watch=self._watch)
        crosses = np.isfinite(hits.t)
        ended = pending[~crosses]
        self._leave(ended[self._is_inside[ended]], end)
        rays, t, normals = pending[crosses], hits.t[crosses], hits.normals[crosses]
        slope = np.einsum("ij,ij->i", normals, self._directions[rays])
        # A ray that leaves without having entered did so where the last crossing was, too near to it to be found.
        missed = (slope >= 0) & ~self._is_inside[rays]
        self._begin(rays[missed], start, np.zeros((np.count_nonzero(missed), 3), np.float32))
        start[rays] = t
        self._leave(rays[slope >= 0], start)
        entering = (slope < 0) & ~self._is_inside[rays]
        self._begin(rays[entering], start, normals[entering])
        # Where a ray grazes the surface it takes longer until the density tells on which side it is.
        step = np.minimum(_STEP / np.maximum(np.abs(slope), _STEP), _LONGEST_STEP) * self._radius
        start[rays] = np.minimum(t + np.maximum(step, 16 * np.spacing(t)), end[rays])
        return np.asarray(rays, np.int64)

    def _begin(self, rays: npt.NDArray[np.int64], t: npt.NDArray[np.float64], normals: FloatArray) -> None:
        """Begin spans of rays at distances by ray."""
        self._is_inside[rays], self._enter[rays], self._normal[rays] = True, t[rays], normals

    def _leave(self, rays: npt.NDArray[np.int64], t: npt.NDArray[np.float64]) -> None:
        """End the spans of rays at distances by ray."""
        self._found.append((rays, self._enter[rays], t[rays], self._normal[rays]))
        self._is_inside[rays] = False

    def _joined(self) -> Spans:
        rays, enter, leave, normal = (np.concatenate(parts) for parts in zip(*self._found, strict=True))
        order = np.lexsort((enter, rays))
        rays, enter, leave = rays[order], enter[order], leave[order]
        height, width = self._camera.active_region.height, self._camera.active_region.width
        scale = self._scale[rays]
        return Spans((height, width), rays, enter / scale, leave / scale, leave - enter, normal[order])
