"""Jets: a fountain of 100,000 ballistic particles, as in Kanamori, Szego and Nishita 2008, figure 12.

It stresses what particle systems without a simulation make: dense jets that thin out into separate droplets, seen against the
sky. Particles fly along parabolas, in closed form, so that any frame is there at once; where they fall into the basin they
bounce once. A droplet that has come down is thrown up again, so from the fountain's full height on their number stays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..addon.fluid.balls import Balls

if TYPE_CHECKING:
    import bpy

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81
"""Blender units a second squared."""
FRAMES_PER_SECOND = 25
FULL_FRAME = 50
"""From here on all particles fly."""
RINGS = ((1, 0.0, 0.0, 6.2, 0.20), (8, 0.3, 13.0, 4.9, 0.40), (16, 1.25, -19.0, 3.6, 0.40))
"""For each ring of jets: how many, its radius (Blender units), how far jets lean outwards (degrees), their speed (Blender units
a second), and the share of all particles."""
NOZZLE_RADIUS = 0.025
"""Blender units."""
SPREAD = 0.016
"""Standard deviation of the velocity in each direction, of the speed: it tears the jets into droplets."""
BOUNCE, BOUNCE_SPREAD = 0.15, 0.08
"""Of the speed: what a particle keeps when it bounces, and the standard deviation of what it gets in each direction."""
EYE, TARGET = (0.0, -6.4, 2.0), (0.0, 0.0, 0.88)
"""A camera that sees the full fountain, Blender units."""
RADIUS_RANGE = (0.010, 0.024)
"""Least and greatest influence radius, Blender units."""


def balls(count: int = 100_000, seed: int = 1, frame: int = FULL_FRAME) -> Balls:
    """The particles that fly at a frame from 1 on: none at first, `count` from FULL_FRAME on; the same for the same seed."""
    random = np.random.default_rng(seed)
    nozzles, velocities = _jets(count, random)
    bounces = _bounces(velocities, random)
    flight, hop = 2 / GRAVITY * velocities[:, 2], 2 / GRAVITY * bounces[:, 2]
    # Each is born within its own life, so that at any time as many are young as old.
    ages = (frame - 1) / FRAMES_PER_SECOND - random.uniform(0, flight + hop)
    radii = random.uniform(*RADIUS_RANGE, count)
    is_born = ages > 0
    ages %= flight + hop
    bounced = (ages >= flight)[:, None]
    since = ages[:, None] - bounced * flight[:, None]
    falls = nozzles + bounced * velocities * (1, 1, 0) * flight[:, None]
    speeds = np.where(bounced, bounces, velocities)
    positions = falls + speeds * since - (0, 0, GRAVITY / 2) * since**2
    speeds = speeds - (0, 0, GRAVITY) * since
    return Balls(positions[is_born], radii[is_born], velocities=speeds[is_born], ids=np.flatnonzero(is_born))


def build(scene: bpy.types.Scene, *, count: int = 100_000, seed: int = 1, frame: int = FULL_FRAME) -> bpy.types.Object:
    """Put the particles of one frame into `scene` as the vertices of an object, with a camera and lights; return the object."""
    # Imported here so that the balls can be had without Blender.
    from . import scene_parts

    scene_parts.set_frames(scene, 1)
    scene_parts.add_camera(scene, EYE, TARGET)
    scene_parts.add_lights(scene)
    return scene_parts.add_balls(scene, "Jets", balls(count, seed, frame))


def _jets(count: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(count, 3) where in the nozzles particles are born, at the height 0, and (count, 3) velocities."""
    jets, radius, lean, speed, share = np.array(RINGS).T
    ring = random.choice(len(RINGS), count, p=share)
    bearing = 2 * np.pi / jets[ring] * random.integers(0, jets[ring])
    outwards = np.stack([np.cos(bearing), np.sin(bearing), np.zeros(count)], axis=1)
    radians = np.radians(lean[ring])[:, None]
    directions = np.sin(radians) * outwards + np.cos(radians) * (0, 0, 1)
    velocities = speed[ring, None] * (directions + SPREAD * random.normal(size=(count, 3)))
    across, around = NOZZLE_RADIUS * np.sqrt(random.random(count)), random.uniform(0, 2 * np.pi, count)
    in_nozzle = np.stack([across * np.cos(around), across * np.sin(around), np.zeros(count)], axis=1)
    return radius[ring, None] * outwards + in_nozzle, velocities


def _bounces(velocities: FloatArray, random: np.random.Generator) -> FloatArray:
    """(count, 3) velocities after the bounce; upwards again."""
    speed = np.linalg.norm(velocities, axis=1, keepdims=True)
    bounces: FloatArray = BOUNCE * velocities + BOUNCE_SPREAD * speed * random.normal(size=velocities.shape)
    bounces[:, 2] = np.abs(bounces[:, 2])
    return bounces


if __name__ == "__main__":
    from .shell import save_sample

    raise SystemExit(save_sample(build))
