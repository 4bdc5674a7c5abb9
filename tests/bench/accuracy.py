"""How far a surface is from the true one, along rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import meniscus

FloatArray = npt.NDArray[np.float64]

_PAIRS_AT_ONCE = 4_000_000


@dataclass(frozen=True)
class Rays:
    """(count, 3) origins and unit directions in world space."""

    origins: FloatArray
    directions: FloatArray


@dataclass(frozen=True)
class Hits:
    """(count,) distances, infinite where a ray meets nothing, and (count, 3) unit normals."""

    t: FloatArray
    normals: FloatArray


@dataclass(frozen=True)
class Deviation:
    """How two surfaces differ along the same rays.

    Attributes
    ----------
    compared
        Rays that meet both within an influence radius of each other.
    elsewhere
        Of all rays that meet one of them, the share that does not count among `compared`: a silhouette or a hole lies between.
    distance
        Root mean square of the differences of the compared distances, influence radii; None where there are none.
    angle
        Root mean square of the angles between the compared normals, degrees; None where there are none.
    """

    compared: int
    elsewhere: float
    distance: float | None
    angle: float | None


def deviation(found: Hits, true: Hits, radius: float) -> Deviation:
    """Compare hits with the true ones."""
    meets_one = np.isfinite(found.t) | np.isfinite(true.t)
    meets_both = np.isfinite(found.t) & np.isfinite(true.t)
    difference = np.full(len(true.t), np.inf)
    difference[meets_both] = np.abs(found.t[meets_both] - true.t[meets_both]) / radius
    compared = difference <= 1
    count = int(compared.sum())
    if count == 0:
        return Deviation(0, float(meets_one.any()), None, None)
    angles = angles_between(found.normals[compared], true.normals[compared])
    return Deviation(
        count,
        1 - count / int(meets_one.sum()),
        float(np.sqrt(np.mean(difference[compared] ** 2))),
        float(np.sqrt(np.mean(angles**2))),
    )


def angles_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Of unit vectors (count, 3), degrees; exact also where they are small."""
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    angles: FloatArray = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", first, second)))
    return angles


def pixel_grid(camera: meniscus.Camera, count: int) -> npt.NDArray[np.int64]:
    """About `count` pixels, evenly spread, as indices into the flattened image."""
    step = max(1, round(float(np.sqrt(camera.width * camera.height / count))))
    y, x = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
    return (y * camera.width + x).ravel()


def pixel_rays(camera: meniscus.Camera, pixels: npt.NDArray[np.int64]) -> tuple[Rays, FloatArray]:
    """The rays through pixels of a perspective camera, and their unit distance by planar depth."""
    _, directions = camera.view_rays()
    in_view = directions.reshape(-1, 3)[pixels]
    stretch = np.linalg.norm(in_view, axis=1)
    in_world = in_view / stretch[:, None] @ camera.world_from_view[:3, :3].T
    return Rays(np.broadcast_to(camera.eye, in_world.shape).copy(), in_world), stretch


def pixels_at(camera: meniscus.Camera, points: FloatArray) -> npt.NDArray[np.int64]:
    """The pixels that points (count, 3) in the picture are seen in, as indices into the flattened image."""
    in_view = points @ camera.view_from_world[:3, :3].T + camera.view_from_world[:3, 3]
    on_plane = in_view[:, :2] / -in_view[:, 2:]
    cell = (on_plane - (camera.window.left, camera.window.bottom)) / camera.pixel_size
    x, y = cell.astype(np.int64).T
    return np.clip(y, 0, camera.height - 1) * camera.width + np.clip(x, 0, camera.width - 1)


def field_hits(balls: meniscus.Balls, field: meniscus.Field, rays: Rays) -> Hits:
    """Where rays meet the true surface of a field."""
    return Hits(*meniscus.oracle.cast(balls, field, rays.origins, rays.directions))


def sphere_hits(centres: FloatArray, radius: float, rays: Rays) -> Hits:
    """Where rays meet the union of equal spheres, from outside."""
    t = np.full(len(rays.origins), np.inf)
    nearest = np.zeros(len(t), np.int64)
    step = max(1, _PAIRS_AT_ONCE // len(centres))
    for begin in range(0, len(t), step):
        part = slice(begin, begin + step)
        entries = _entries(centres, radius, rays.origins[part], rays.directions[part])
        nearest[part] = entries.argmin(axis=1)
        t[part] = entries.min(axis=1)
    points = rays.origins + np.where(np.isfinite(t), t, 0.0)[:, None] * rays.directions
    return Hits(t, (points - centres[nearest]) / radius)


def _entries(centres: FloatArray, radius: float, origins: FloatArray, directions: FloatArray) -> FloatArray:
    """(rays, spheres) distances at which rays enter spheres, infinite where they do not."""
    along = directions @ centres.T - np.einsum("ij,ij->i", origins, directions)[:, None]
    distance_2 = (origins**2).sum(1)[:, None] - 2 * origins @ centres.T + (centres**2).sum(1)
    under_root = radius**2 - (distance_2 - along**2)
    entries: FloatArray = np.where((under_root >= 0) & (along > 0), along - np.sqrt(np.maximum(under_root, 0)), np.inf)
    return entries


def lone_balls(balls: meniscus.Balls, candidates: npt.NDArray[np.int64]) -> FloatArray:
    """(count, 3) centres of those among the candidates whose influence sphere meets no other ball's. All radii are equal."""
    reach = 2 * float(balls.radii[0])
    order = np.argsort(balls.positions[:, 0])
    positions = balls.positions[order].astype(np.float64)
    centres = balls.positions[candidates].astype(np.float64)
    begins = np.searchsorted(positions[:, 0], centres[:, 0] - reach)
    ends = np.searchsorted(positions[:, 0], centres[:, 0] + reach, side="right")
    is_lone = [
        np.count_nonzero(((positions[begin:end] - centre) ** 2).sum(axis=1) < reach**2) == 1
        for centre, begin, end in zip(centres, begins, ends, strict=True)
    ]
    return centres[np.array(is_lone, bool)]


def probes(centres: FloatArray) -> Rays:
    """Six rays from each centre along the axes: a closed surface around the centre meets them all."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    return Rays(np.repeat(centres, 6, axis=0), np.tile(axes, (len(centres), 1)))


def lost_share(probe_t: FloatArray, radius: float) -> float:
    """Of the probed balls, the share around which no probe meets a surface within the influence radius."""
    return float(np.mean(~np.any(probe_t.reshape(-1, 6) <= radius, axis=1)))
