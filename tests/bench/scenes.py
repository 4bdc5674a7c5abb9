"""The named scenes of the benchmarks: balls, field and camera, the same at every run."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

import meniscus
from meniscus.samples import argon, block, jets, molecule, scattered, store

Point = tuple[float, float, float]

SIZES = ((640, 480), (1920, 1080))
"""Width and height of the pictures, pixels."""
FIELD_OF_VIEW = 0.7
"""Vertical, radians."""
EYE_DIRECTION = (0.48, -0.76, 0.44)
"""From the scene's middle to the eye: a three-quarter view from a little above."""
FILLED = 0.95
"""Share of the picture's height or width that the box around the centres fills, whichever is reached first."""
CROSSINGS = 10
"""Influence spheres that a ray along an axis crosses on its way through a random scene."""
DENSE_RADIUS = 2.0
"""Influence radius in a dense scene, spacings."""
DENSE_JITTER = 0.25
"""Greatest displacement of a ball along an axis in a dense scene, spacings."""
DAM_BREAK_FRAME = 26
"""Where the wave has hit the pillar: a block, thin sheets and lone droplets at once."""
FIGURE_10_SPACING, FIGURE_10_FRAME = 0.0286, 22
"""Of the dam break with about 120,000 particles: their distance at the start, Blender units, and the frame that is shown."""


@dataclass(frozen=True)
class View:
    """A perspective camera with z up: world space, and the vertical field of view in radians."""

    eye: Point
    target: Point
    field_of_view: float


@dataclass(frozen=True)
class Scene:
    """What is rendered.

    Attributes
    ----------
    name
        Identifier on the command line and in the tables.
    make_balls
        Makes the balls, the same each time.
    field
        The density field.
    droplets
        How many of the last balls are droplets beside the bulk; 0 where the scene does not tell.
    view
        From where it is seen; None for the three-quarter view.
    """

    name: str
    make_balls: Callable[[], meniscus.Balls]
    field: meniscus.Field = field(default_factory=meniscus.Field)
    droplets: int = 0
    view: View | None = None

    def camera(self, balls: meniscus.Balls, width: int, height: int) -> meniscus.Camera:
        """The perspective camera that shows `balls`, which are the scene's."""
        if self.view is None:
            return three_quarter_camera(balls, width, height)
        view = self.view
        return meniscus.Camera.perspective(view.eye, view.target, fov_y=view.field_of_view, width=width, height=height)


def random_balls(count: int, seed: int = 1) -> meniscus.Balls:
    """`count` centres, evenly distributed in the unit cube; their common radius makes CROSSINGS hold.

    A ray along an axis stays in the cube for the length 1, and meets the centres within R of it: `count pi R^2` of them.
    """
    positions = np.random.default_rng(seed).random((count, 3), np.float32)
    return meniscus.Balls(positions, np.sqrt(CROSSINGS / (np.pi * count)))


def dense_balls(count: int, seed: int = 1) -> meniscus.Balls:
    """A jittered cubic lattice in the unit cube, filled from below as far as `count` goes."""
    sites = int(np.ceil(np.cbrt(count) - 1e-9))
    z, y, x = np.unravel_index(np.arange(count), (sites, sites, sites))
    jitter = np.random.default_rng(seed).uniform(-DENSE_JITTER, DENSE_JITTER, (count, 3))
    return meniscus.Balls((np.stack([x, y, z], axis=1) + 0.5 + jitter) / sites, DENSE_RADIUS / sites)


def dam_break_balls(spacing: float = 0.06, frame: int = DAM_BREAK_FRAME, frame_end: int = 60) -> meniscus.Balls:
    """One frame of the sample, which is baked up to `frame_end` where it has not been before.

    Blender bakes it in a process of its own, so that no Blender is loaded while timing.
    """
    samples = Path(store.__file__).parent
    scripts = [(samples / f"{name}.py").read_text(encoding="utf-8") for name in ("dam_break", "particle_system", "scene_parts")]
    options = {"spacing": spacing, "frame": frame, "frame_end": frame_end}

    def make(path: Path) -> None:
        command = [sys.executable, "-m", "bench.save_dam_break", str(spacing), str(frame), str(frame_end), str(path)]
        variables = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[1])}
        subprocess.run(command, check=True, stdin=subprocess.DEVNULL, env=variables)

    parameters = {**options, "blender": version("bpy"), "scripts": scripts}
    with np.load(store.stored_file("dam_break_balls", ".npz", parameters, make)) as saved:
        return meniscus.Balls(saved["positions"], saved["radii"], saved["weights"])


def three_quarter_camera(balls: meniscus.Balls, width: int, height: int) -> meniscus.Camera:
    """A perspective camera that looks at the middle of the box around the centres, as near as FILLED allows."""
    low, high = balls.positions.min(axis=0).astype(np.float64), balls.positions.max(axis=0).astype(np.float64)
    middle = (low + high) / 2
    backward = np.array(EYE_DIRECTION) / np.linalg.norm(EYE_DIRECTION)
    right = np.cross((0.0, 0.0, 1.0), backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backward, right), backward])
    corners = (np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T - middle) @ axes.T
    half_height = np.tan(FIELD_OF_VIEW / 2) * FILLED
    # A corner (x, y, z) of the box is in the picture where |x| and |y| are within the window at its distance from the eye.
    across = np.maximum(np.abs(corners[:, 0]) / (half_height * width / height), np.abs(corners[:, 1]) / half_height)
    distance = float(np.max(across + corners[:, 2]))
    far = 2 * distance + float(np.linalg.norm(high - low) + balls.radii.max())
    return meniscus.Camera.perspective(
        middle + distance * backward,
        middle,
        fov_y=FIELD_OF_VIEW,
        width=width,
        height=height,
        clip_start=distance * 1e-3,
        clip_end=far,
    )


_TIGHT = meniscus.Field("wyvill", 0.4)


def _random(name: str, count: int) -> Scene:
    return Scene(name, lambda: random_balls(count), _TIGHT)


def _dense(name: str, count: int) -> Scene:
    return Scene(name, lambda: dense_balls(count), _TIGHT)


def _block(name: str, count: int) -> Scene:
    return Scene(name, lambda: block.balls(count), _TIGHT, droplets=round(count * block.DROPLET_SHARE))


def kanamori_figure_2_balls() -> meniscus.Balls:
    """B0 to B3 in the plane y = 0: a ray along x through the origin enters B2, B1 and B3 in turn, then leaves them."""
    return meniscus.Balls([[-0.6, 0, 1.6], [-0.05, 0, 0.8], [-0.8, 0, -0.8], [0.45, 0, -0.45]], [0.8, 1.05, 1.1, 1.0])


def _kanamori_scenes() -> tuple[Scene, ...]:
    """Those of Kanamori, Szego and Nishita 2008, see docs/kanamori_2008.md."""
    table_1 = [
        Scene(f"kanamori_table_1_{count // 1000}k", partial(scattered.balls, count))
        for count in (10_000, 50_000, 100_000, 200_000)
    ]
    tank = partial(dam_break_balls, FIGURE_10_SPACING, FIGURE_10_FRAME, FIGURE_10_FRAME)
    splash = meniscus.Field("wyvill", 0.4)
    return (
        Scene("kanamori_figure_1", partial(scattered.balls, 1000)),
        *table_1,
        Scene("kanamori_figure_2", kanamori_figure_2_balls, view=View((0.0, -6.0, 0.0), (0.0, 0.0, 0.25), 0.6)),
        Scene("kanamori_figure_10_whole", tank, splash, view=View((4.6, -6.2, 3.2), (2.0, 0.5, 0.95), 0.50)),
        Scene("kanamori_figure_10_close", tank, splash, view=View((4.6, -6.2, 3.2), (3.2, 0.6, 1.05), 0.25)),
        Scene(
            "kanamori_figure_11",
            molecule.balls,
            meniscus.Field("wyvill", molecule.ISOVALUE),
            view=View(molecule.EYE, (0.0, 0.0, 0.0), 0.45),
        ),
        Scene("kanamori_figure_12_early", partial(jets.balls, frame=14), view=View(jets.EYE, jets.TARGET, 0.40)),
        Scene("kanamori_figure_12_full", jets.balls, view=View(jets.EYE, jets.TARGET, 0.40)),
    )


SCENES = {
    scene.name: scene
    for scene in (
        _random("random_1k", 1000),
        _random("random_10k", 10_000),
        _random("random_100k", 100_000),
        _random("random_200k", 200_000),
        _random("random_1m", 1_000_000),
        _dense("dense_120k", 120_000),
        _dense("dense_1m", 1_000_000),
        Scene("argon", argon.balls),
        Scene("dam_break", dam_break_balls),
        _block("block_10k", 10_000),
        _block("block_120k", 120_000),
        _block("block_1m", 1_000_000),
        *_kanamori_scenes(),
    )
}
