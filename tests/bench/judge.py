"""Judges pictures and meshes of one scene by what the oracle says of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

import meniscus

from .accuracy import (
    Deviation,
    FloatArray,
    Hits,
    Rays,
    deviation,
    field_hits,
    lone_balls,
    lost_share,
    pixel_grid,
    pixel_rays,
    pixels_at,
    probes,
    sphere_hits,
)
from .peers.peer import Aim
from .worker import Worker

RAYS = 1000
"""About how many pixels are compared."""
DROPLETS = 1000
"""How many droplets are looked for, where there are as many."""
CAST_LIMIT = 600.0
"""Seconds to build the tree of a mesh and cast the rays at it."""


NOTHING = 1e10
"""Depth where there is no surface."""
CHANNELS = ("Depth.Z", "Normal.X", "Normal.Y", "Normal.Z")


@dataclass(frozen=True)
class Judgement:
    """How good a surface is; None where it is not judged by that.

    Attributes
    ----------
    deviation
        From the surface that it aims at.
    lost
        Share of the lone droplets that are looked for and not there.
    """

    deviation: Deviation | None = None
    lost: float | None = None


class Judge:
    """Knows a scene's balls, whose radius is the same for all, and casts the rays at them once.

    Parameters
    ----------
    balls, camera
        The scene, and what the judged picture shows of it.
    droplets
        How many of the last balls are droplets.
    caster
        Runs `bench.peers.ray_worker`.
    folder
        For files of rays and hits.
    """

    def __init__(self, balls: meniscus.Balls, camera: meniscus.Camera, droplets: int, caster: Worker, folder: Path) -> None:
        self._balls, self._camera, self._caster, self._folder = balls, camera, caster, folder
        self._radius = float(balls.radii[0])
        self._pixels = pixel_grid(camera, RAYS)
        self._rays, self._stretch = pixel_rays(camera, self._pixels)
        self._droplets = _droplet_centres(balls, droplets)
        self._true: dict[tuple[Aim, meniscus.Field], Hits] = {}

    def own_picture(self, path: Path, field: meniscus.Field) -> Judgement:
        """Judge a picture that `bench.render_worker` saved."""
        with np.load(path) as image:
            depth, normals = image["depth"].ravel().astype(np.float64), image["normal"].reshape(-1, 3)
        depth[depth >= NOTHING] = np.inf
        lost = self._lost_in_picture(depth, field) if len(self._droplets) else None
        return Judgement(self._deviation_of_pixels(depth, normals, "field", field), lost)

    def picture(self, path: Path, aim: Aim, field: meniscus.Field) -> Judgement:
        """Judge a picture in influence radii that a peer saved."""
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
        # The first row of the file is the uppermost.
        depth, *normal = (channels[f"ViewLayer.{name}"][::-1].ravel().astype(np.float64) for name in CHANNELS)
        depth = np.where(depth < NOTHING, depth * self._radius, np.inf)
        return Judgement(self._deviation_of_pixels(depth, np.stack(normal, axis=1), aim, field))

    def _deviation_of_pixels(self, depth: FloatArray, normals: FloatArray, aim: Aim, field: meniscus.Field) -> Deviation:
        found = Hits(depth[self._pixels] * self._stretch, normals[self._pixels].astype(np.float64))
        return deviation(found, self._truth(aim, field), self._radius)

    def mesh(self, path: Path, aim: Aim, field: meniscus.Field) -> Judgement:
        """Judge a mesh in influence radii that `bench.peers.worker` saved; CaseError where no ray can be cast at it."""
        found = None if aim == "none" else self._cast(path, self._rays, self._camera.clip_end)
        far = deviation(found, self._truth(aim, field), self._radius) if found else None
        if not len(self._droplets):
            return Judgement(far)
        return Judgement(far, lost_share(self._cast(path, probes(self._droplets), self._radius).t, self._radius))

    def _truth(self, aim: Aim, field: meniscus.Field) -> Hits:
        if (aim, field) not in self._true:
            self._true[aim, field] = self._true_hits(aim, field)
        return self._true[aim, field]

    def _true_hits(self, aim: Aim, field: meniscus.Field) -> Hits:
        if aim == "field":
            return field_hits(self._balls, field, self._rays)
        kernel_radius = float(field.kernel_radii(self._balls.radii[:1], self._balls.weights[:1])[0])
        return sphere_hits(self._balls.positions.astype(np.float64), kernel_radius, self._rays)

    def _lost_in_picture(self, depth: FloatArray, field: meniscus.Field) -> float:
        """Of the droplets that the rays of their own pixels meet first, the share that the picture does not show there."""
        pixels = pixels_at(self._camera, self._droplets)
        rays, stretch = pixel_rays(self._camera, pixels)
        true = field_hits(self._balls, field, rays)
        far = np.linalg.norm(self._droplets - self._camera.eye, axis=1)
        is_seen = np.abs(true.t - far) <= self._radius
        is_lost = ~(np.abs(depth[pixels] * stretch - far) <= self._radius)
        return float(np.mean(is_lost[is_seen]))

    def _cast(self, mesh: Path, rays: Rays, reach: float) -> Hits:
        """World space in and out; in between the unit is the influence radius."""
        sent, received = self._folder / "rays.npz", self._folder / "hits.npz"
        np.savez(sent, origins=rays.origins / self._radius, directions=rays.directions, reach=reach / self._radius)
        files = {"mesh": str(mesh), "rays": str(sent), "hits": str(received)}
        self._caster.ask({"do": "cast rays at its mesh", **files}, CAST_LIMIT)
        with np.load(received) as hits:
            return Hits(hits["t"] * self._radius, hits["normals"])


def _droplet_centres(balls: meniscus.Balls, droplets: int) -> FloatArray:
    """Centres of lone droplets, evenly chosen."""
    if droplets == 0:
        return np.empty((0, 3))
    candidates = np.linspace(len(balls) - droplets, len(balls) - 1, min(droplets, DROPLETS)).astype(np.int64)
    return lone_balls(balls, candidates)
