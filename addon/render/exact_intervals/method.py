"""Exact Intervals for a camera: balls are projected to find the pixels that they may cover."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ...fluid.camera import Camera, Region
from ...fluid.field import Field
from ...fluid.view_balls import ViewBalls
from ..method import Surface
from .crossings import FloatArray, IntArray, Rays, Spheres, blended_colors, cross, first_crossings, normals

# Candidate pairs of a band of rows; some 500 bytes each while they are worked on, in each thread.
_PAIRS_PER_BAND = 400_000
_MAX_THREADS = 8


class ExactIntervals:
    """See :mod:`exact_intervals`."""

    @property
    def device(self) -> str:
        """The processor's architecture."""
        return f"CPU ({platform.machine()}), numpy {np.__version__}"

    def find_surface(
        self, balls: ViewBalls, camera: Camera, field: Field, wants_color: bool, check_cancelled: Callable[[], None]
    ) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        surface = Surface.empty(camera, wants_color and balls.colors is not None)
        covered = pixel_bounds(balls, camera)

        def fill(band: tuple[int, int]) -> int:
            check_cancelled()
            return _fill_rows(surface, band, balls, camera, field, covered)

        # numpy lets other threads run while it computes.
        with ThreadPoolExecutor(min(os.cpu_count() or 1, _MAX_THREADS)) as pool:
            surface.counts["ray_ball_pairs"] = sum(pool.map(fill, _bands(covered, camera.height)))
        return surface


def create() -> ExactIntervals:
    """The method, ready to run."""
    return ExactIntervals()


def _fill_rows(
    surface: Surface, band: tuple[int, int], balls: ViewBalls, camera: Camera, field: Field, covered: IntArray
) -> int:
    """Find the surface in the rows [begin, end) of `band`; the number of pairs of rays and influence spheres that meet."""
    rows, shape = slice(*band), (band[1] - band[0], camera.width)
    spheres = Spheres(balls.centers, balls.radii, balls.weights, balls.kernel_radii)
    rays, stretch = _rays(camera, *band)
    pairs = cross(rays, spheres, *_candidates(covered, camera.width, *band))
    t = first_crossings(rays, spheres, pairs, field)
    surface.depth[rows] = (t / stretch).reshape(shape)
    in_view = normals(rays, spheres, pairs, t, field)
    surface.normal[rows] = (in_view @ camera.world_from_view[:3, :3].T).reshape(*shape, 3)
    if surface.color is not None and balls.colors is not None:
        surface.color[rows] = blended_colors(rays, spheres, pairs, t, field, balls.colors).reshape(*shape, 3)
    return len(pairs.ray)


def pixel_bounds(balls: ViewBalls, camera: Camera) -> IntArray:
    """Pixels whose centres an influence sphere may cover: (M, 4) x_min, x_max, y_min, y_max, maxima exclusive.

    The tangents from the eye in each axis' plane (Kanamori et al. 2008, appendix B), written with directions, so that
    spheres that reach behind the eye come out right as well.
    """
    window, size = camera.window, camera.pixel_size
    columns = []
    for axis, first, count in ((0, window.left, camera.width), (1, window.bottom, camera.height)):
        low, high = _extent(balls.centers[:, axis], -balls.centers[:, 2], balls.radii, camera.is_perspective)
        # A little wider, so that rounding cannot lose a pixel; pixel i has its centre at i + 0.5.
        columns.append(np.clip(np.ceil((low - first) / size[axis] - 0.5 - 1e-6), 0, count))
        columns.append(np.clip(np.floor((high - first) / size[axis] - 0.5 + 1e-6) + 1, 0, count))
    bounds = np.stack(columns, axis=1).astype(np.intp)
    bounds[:, 1::2] = np.maximum(bounds[:, 1::2], bounds[:, 0::2])
    return bounds


def _extent(
    coordinate: FloatArray, depth: FloatArray, radius: FloatArray, is_perspective: bool
) -> tuple[FloatArray, FloatArray]:
    """Where spheres begin and end along one axis, in units of the camera's window."""
    if not is_perspective:
        return coordinate - radius, coordinate + radius
    tangent_2 = coordinate**2 + depth**2 - radius**2
    tangent = np.sqrt(np.maximum(tangent_2, 0))
    edges = []
    for side in (-1.0, 1.0):
        across = coordinate * tangent + side * depth * radius
        forward = depth * tangent - side * coordinate * radius
        bounded = (tangent_2 > 0) & (forward > 0)
        edges.append(np.divide(across, forward, out=np.full_like(across, side * np.inf), where=bounded))
    return edges[0], edges[1]


def _bands(covered: IntArray, height: int) -> Iterator[tuple[int, int]]:
    """Rows [begin, end) with about as many candidate pairs as are held at once."""
    width = covered[:, 1] - covered[:, 0]
    starts = np.bincount(covered[:, 2], width, height + 1) - np.bincount(covered[:, 3], width, height + 1)
    filled = np.cumsum(np.cumsum(starts)[:height])
    begin = 0
    while begin < height:
        before = filled[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(filled, before + _PAIRS_PER_BAND)))
        yield begin, min(end, height)
        begin = min(end, height)


def _candidates(covered: IntArray, image_width: int, begin: int, end: int) -> tuple[IntArray, IntArray]:
    """Rays of the rows [begin, end), counted from the first, and the balls that may cover them."""
    ball = np.flatnonzero((covered[:, 2] < end) & (covered[:, 3] > begin) & (covered[:, 0] < covered[:, 1]))
    x_min, width = covered[ball, 0], covered[ball, 1] - covered[ball, 0]
    y_min = np.maximum(covered[ball, 2], begin)
    count = width * (np.minimum(covered[ball, 3], end) - y_min)
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(offset, np.repeat(width, count))
    ray = (np.repeat(y_min, count) + row - begin) * image_width + np.repeat(x_min, count) + column
    return ray, np.repeat(ball, count)


def _rays(camera: Camera, begin: int, end: int) -> tuple[Rays, FloatArray]:
    """The view-space rays of the rows [begin, end), and their length for each unit of planar depth."""
    band = replace(camera, region=Region(0, begin, camera.width, end))
    origins, directions = (array.reshape(-1, 3) for array in band.view_rays())
    stretch: npt.NDArray[np.float64] = np.linalg.norm(directions, axis=1)
    rays = Rays(origins, directions / stretch[:, None], camera.clip_start * stretch, camera.clip_end * stretch)
    return rays, stretch
