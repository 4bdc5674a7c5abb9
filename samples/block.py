"""Block: a dense block of any number of balls with some droplets outside.

It stresses the inside of a fluid: dozens of balls overlap at every point of a ray, while all but the outer layer is hidden.
The lattice is jittered, so that no crossing falls on another by accident. Influence radii are two spacings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..addon.fluid.balls import Balls

if TYPE_CHECKING:
    import bpy

DROPLET_SHARE = 0.02
JITTER = 0.25
"""Greatest displacement of a ball along an axis, spacings."""
RADIUS = 2.0
"""Influence radius, spacings."""
SIDE = 2.0
"""Of the block, Blender units; it is centred in the origin."""
SPRAY_SIDE = 3.6
"""Of the cube that the droplets fill around the block, Blender units."""


def balls(count: int = 100_000, seed: int = 1) -> Balls:
    """`count` balls, 2 % of them droplets; the same for the same seed."""
    random = np.random.default_rng(seed)
    droplets = round(count * DROPLET_SHARE)
    lattice, spacing = _lattice(count - droplets)
    lattice += random.uniform(-JITTER, JITTER, lattice.shape) * spacing
    spray = _droplets(droplets, SIDE / 2 + RADIUS * spacing, random)
    return Balls(np.concatenate([lattice, spray]), RADIUS * spacing, ids=np.arange(count))


def build(scene: bpy.types.Scene, *, count: int = 100_000, seed: int = 1) -> bpy.types.Object:
    """Put the balls into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, (5.0, -6.5, 4.0), (0.0, 0.0, 0.0))
    scene_parts.add_lights(scene)
    return scene_parts.add_balls(scene, "Block", balls(count, seed))


def _lattice(count: int) -> tuple[npt.NDArray[np.float64], float]:
    """The lowest `count` sites of a cubic lattice that fills the block, and its spacing."""
    sites = max(1, round(count ** (1 / 3)))
    sites += sites**3 < count
    spacing = SIDE / sites
    z, y, x = np.unravel_index(np.arange(count), (sites, sites, sites))
    return (np.stack([x, y, z], axis=1) + 0.5) * spacing - SIDE / 2, spacing


def _droplets(count: int, inner: float, random: np.random.Generator) -> npt.NDArray[np.float64]:
    """`count` points in the spray's cube whose greatest coordinate is at least `inner`."""
    # A point on the cube of half side h, with h drawn so that the volume between the cubes is filled evenly.
    outer = max(SPRAY_SIDE / 2, inner * 1.2)
    half_side = np.cbrt(random.uniform(inner**3, outer**3, count))
    points = random.uniform(-1.0, 1.0, (count, 3))
    points[np.arange(count), random.integers(0, 3, count)] = random.choice([-1.0, 1.0], count)
    points *= half_side[:, None]
    return points


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
