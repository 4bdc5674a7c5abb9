"""Scattered: balls of random radii at random places in a cube, as in Kanamori, Szego and Nishita 2008.

It stresses partial overlap: single balls, pairs, chains and clumps occur side by side, and many silhouettes cross a ray.
Radii go with the mean spacing, so that the look and the overlap do not depend on the number of balls.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..addon.fluid.balls import Balls

if TYPE_CHECKING:
    import bpy

SIDE = 2.0
"""Of the cube, Blender units; it is centred in the origin."""
RADIUS_RANGE = (0.4, 1.2)
"""Least and greatest influence radius, mean spacings."""


def balls(count: int = 1000, seed: int = 1) -> Balls:
    """`count` balls, the same for the same seed."""
    random = np.random.default_rng(seed)
    spacing = SIDE / max(count, 1) ** (1 / 3)
    positions = random.uniform(-SIDE / 2, SIDE / 2, (count, 3))
    radii = random.uniform(*RADIUS_RANGE, count) * spacing
    return Balls(positions, radii, ids=np.arange(count))


def build(scene: bpy.types.Scene, *, count: int = 1000, seed: int = 1) -> bpy.types.Object:
    """Put the balls into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, (3.5, -4.5, 2.5), (0.0, 0.0, 0.0))
    scene_parts.add_lights(scene)
    return scene_parts.add_balls(scene, "Scattered", balls(count, seed))


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
