"""The parts of rays that lie in the fluid: for its thickness, and for deep images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.field import Field
from ..fluid.turning import turned
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


def find_spans(
    balls: Balls,
    camera: Camera,
    field: Field,
    hit: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
    watch: Watch = let_interrupt,
) -> Spans:
    """Find all spans of the rays through the centres of a camera's pixels.

    From each crossing the next one is looked for, so that the time goes with the crossings, not with the balls.

    Parameters
    ----------
    balls, camera, field
        What is seen, from where, and which isosurface of it.
    hit
        (height, width) of the camera's region: whose rays are asked for; None for all.
    threads, watch
        See :class:`fitted_bvh.FittedBvh`.

    Raises
    ------
    DeviceError
        The native core is missing, or there is too little memory.
    """
    return _Search(balls, camera, field, hit, threads, watch).spans()


class _Search:
    def __init__(
        self,
        balls: Balls,
        camera: Camera,
        field: Field,
        hit: npt.NDArray[np.bool_] | None,
        threads: int,
        watch: Watch,
    ) -> None:
        self._camera, self._threads, self._watch = camera, threads, watch
        self._tree = FittedBvh(balls, field, threads=threads, watch=watch)
        self._radius = float(balls.radii.min()) if len(balls) else 1.0
        region = camera.active_region
        self._shape = region.height, region.width
        self._pixels = np.arange(region.height * region.width) if hit is None else np.flatnonzero(hit)
        self._origins, self._directions, self._scale = self._rays()
        count = len(self._pixels)
        self._is_inside, self._enter = np.zeros(count, np.bool_), camera.clip_start * self._scale
        self._normal = np.zeros((count, 3), np.float32)
        self._found: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64], FloatArray]] = []

    def _rays(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """World space: origins and unit directions (count, 3), and the factor from planar depth to length (count,)."""
        camera = self._camera
        turn = camera.world_from_view[:3, :3]
        x, y = camera.pixel_centers()
        rows, columns = np.divmod(self._pixels, self._shape[1])
        plane = np.stack([x[columns], y[rows], np.zeros(len(rows))], axis=1)
        if camera.is_perspective:
            plane[:, 2] = -1
            scale = np.sqrt(np.einsum("ij,ij->i", plane, plane))
            directions = turned(plane / scale[:, None], turn.T)
            return np.ascontiguousarray(np.broadcast_to(camera.eye, plane.shape)), directions, scale
        forward = np.ascontiguousarray(np.broadcast_to(-turn[:, 2], plane.shape))
        return turned(plane, turn.T) + camera.eye, forward, np.ones(len(rows))

    def spans(self) -> Spans:
        start, end = self._enter.copy(), self._camera.clip_end * self._scale
        pending: npt.NDArray[np.int64] = np.arange(len(start))
        is_first = True
        while len(pending):
            pending = self._advance(pending, start, end, is_first)
            is_first = False
        return self._joined()

    def _advance(
        self, pending: npt.NDArray[np.int64], start: npt.NDArray[np.float64], end: npt.NDArray[np.float64], is_first: bool
    ) -> npt.NDArray[np.int64]:
        """Take one more crossing of each ray behind `start`, which moves on; the rays that may have more to come."""
        hits = self._tree.first_hit(
            self._origins[pending], self._directions[pending], start[pending], threads=self._threads, watch=self._watch
        )
        slopes = np.einsum("ij,ij->i", hits.normals, self._directions[pending])
        if is_first:
            # What a ray leaves next it is in, wherever that is.
            self._is_inside = np.isfinite(hits.t) & (slopes > 0)
        crosses = hits.t < end[pending]
        ended = pending[~crosses]
        self._leave(ended[self._is_inside[ended]], end)
        rays, t, normals, slope = pending[crosses], hits.t[crosses], hits.normals[crosses], slopes[crosses]
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
        scale = self._scale[rays]
        return Spans(self._shape, self._pixels[rays], enter / scale, leave / scale, leave - enter, normal[order])
