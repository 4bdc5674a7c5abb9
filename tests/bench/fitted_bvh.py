"""The fitted BVH: how long it takes to build, and how many rays of ambient occlusion it casts.

Occlusion rays start where the rays of a 640x480 picture meet the surface, lifted off it by a thousandth of R, and go to
infinity in directions around the normal, more of them near it (by the cosine of the angle): rays without coherence.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meniscus

from . import machine, report
from .accuracy import Rays, pixel_rays
from .renderers import PREPARE_LIMIT
from .scenes import SCENES, SIZES
from .timing import Outcome, Plan, Sample, Statistics, interleave, statistics_by_stage
from .worker import Message, Worker, serve

BUILD, CAST = "build the tree", "cast occlusion rays"
BUILT_SCENES = ("dense_120k", "dense_1m")
CAST_SCENE = "dense_120k"
RAYS_A_POINT = 4
LIFT = 1e-3
"""Of a ray's start off the surface, influence radii."""


@dataclass(frozen=True)
class Row:
    """One task on one scene.

    Attributes
    ----------
    threads
        How many it runs on.
    rays
        That are cast at a time; 0 where the tree is built.
    whole
        Milliseconds; None where it failed, see `problem`.
    """

    task: str
    scene: str
    threads: int
    rays: int
    whole: Statistics | None
    problem: str


def measure(scenes: Sequence[str], plan: Plan, limit: float, log: Path) -> list[Row]:
    """Build and cast in turn, on one thread and on one for each core, in a process of its own.

    Only for those of its scenes that are among `scenes`.
    """
    wanted = [(BUILD, scene) for scene in BUILT_SCENES if scene in scenes]
    wanted += [(CAST, CAST_SCENE)] if CAST_SCENE in scenes else []
    tasks = [(*task, threads) for task in wanted for threads in sorted({1, machine.usable_cores()})]
    rays: dict[tuple[str, str, int], int] = {}

    def run(worker: Worker, task: tuple[str, str, int]) -> Sample:
        reply = worker.ask({"do": task[0], "scene": task[1], "threads": task[2]}, limit)
        rays[task] = reply["rays"]
        return {"whole": reply["milliseconds"]}

    with Worker([sys.executable, "-m", __name__], log) as worker:
        for _, scene in wanted:
            worker.ask({"do": "prepare", "scene": scene}, PREPARE_LIMIT)
        outcomes = interleave({task: partial(run, worker, task) for task in tasks}, plan)
    return [_row(task, outcome, rays.get(task, 0)) for task, outcome in outcomes.items()]


def _row(task: tuple[str, str, int], outcome: Outcome, rays: int) -> Row:
    return Row(*task, rays, statistics_by_stage(outcome).get("whole"), outcome.problem)


def table_of(rows: Sequence[Row]) -> str:
    """A row for each task; rays only where some are cast."""
    headers = ["fitted BVH", "scene", "threads", "milliseconds", "rays", "million rays a second and core"]
    return report.table(headers, [_cells(row) for row in rows])


def _cells(row: Row) -> list[str]:
    whole = report.median_and_spread(row.whole) if row.whole else ""
    speed = f"{row.rays / row.whole.median / 1e3 / row.threads:.3g}" if row.rays and row.whole else ""
    times = "; ".join(filter(None, [whole, row.problem]))
    return [row.task, row.scene, str(row.threads), times, str(row.rays or ""), speed]


def hemisphere_rays(points: npt.NDArray[np.float64], normals: npt.NDArray[np.float64], count: int, seed: int = 1) -> Rays:
    """`count` rays from each point (N, 3), distributed around its unit normal by the cosine of the angle to it."""
    random = np.random.default_rng(seed)
    # A point on the sphere that touches the surface from outside, as seen from where it touches.
    on_sphere = random.normal(size=(len(points) * count, 3))
    on_sphere /= np.linalg.norm(on_sphere, axis=1, keepdims=True)
    directions = np.repeat(normals, count, axis=0) + on_sphere
    return Rays(np.repeat(points, count, axis=0), directions / np.linalg.norm(directions, axis=1, keepdims=True))


@cache
def _balls(scene: str) -> meniscus.Balls:
    return SCENES[scene].make_balls()


@cache
def _tree_and_rays(scene: str) -> tuple[meniscus.FittedBvh, Rays]:
    balls = _balls(scene)
    tree = meniscus.FittedBvh(balls, SCENES[scene].field)
    camera = SCENES[scene].camera(balls, *SIZES[0])
    rays, _ = pixel_rays(camera, np.arange(camera.width * camera.height))
    hits = tree.first_hit(rays.origins, rays.directions)
    is_hit = np.isfinite(hits.t)
    normals = hits.normals[is_hit].astype(np.float64)
    points = rays.origins[is_hit] + hits.t[is_hit, None] * rays.directions[is_hit]
    return tree, hemisphere_rays(points + LIFT * float(balls.radii[0]) * normals, normals, RAYS_A_POINT)


def _handle(request: Message) -> Message:
    """The child's end of `measure`."""
    if request["do"] == "prepare":
        return {"balls": len(_balls(request["scene"]))}
    if request["do"] == BUILD:
        balls, field = _balls(request["scene"]), SCENES[request["scene"]].field
        start = time.perf_counter()
        meniscus.FittedBvh(balls, field, threads=request["threads"])
        return {"milliseconds": (time.perf_counter() - start) * 1e3, "rays": 0}
    tree, rays = _tree_and_rays(request["scene"])
    start = time.perf_counter()
    tree.any_hit(rays.origins, rays.directions, threads=request["threads"])
    return {"milliseconds": (time.perf_counter() - start) * 1e3, "rays": len(rays.origins)}


if __name__ == "__main__":
    serve(_handle)
