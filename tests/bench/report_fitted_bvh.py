"""Prints the tables of docs/fitted_bvh.md: PYTHONPATH=tests .venv/bin/python -m bench.report_fitted_bvh

What Gourmel et al. 2010 measure in tables 1 and 3 to 5, on scenes like theirs and on dense ones: the tree with and without
each refinement. Counts are exact; times are processor time, the least of several
runs on one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

import meniscus
from meniscus.addon.render.fitted_bvh import RayCounts
from meniscus.samples import scattered

from .gourmel_scenes import FIELD, molecule, pool, tornado

WIDTH, HEIGHT = 640, 480
RUNS = 5

OURS: Mapping[str, object] = {}
PAPER = {"proves": False}
OVERLAPPING = {"hierarchy": "overlapping", "proves": False}
PLAIN = {"tightens": False, "discards": False, "proves": False}


def dense(count: int) -> meniscus.Balls:
    """A jittered lattice, R = 2 spacings."""
    sites = round(count ** (1 / 3))
    lattice = (np.stack(np.unravel_index(np.arange(sites**3), (sites,) * 3), axis=1) + 0.5) / sites
    jitter = np.random.default_rng(4).uniform(-0.25, 0.25, lattice.shape) / sites
    return meniscus.Balls(lattice + jitter, 2 / sites)


SCENES: dict[str, Callable[[], meniscus.Balls]] = {
    "scattered 30k": lambda: scattered.balls(30_000),
    "scattered 100k": lambda: scattered.balls(100_000),
    "tornado 4k": lambda: tornado(4_000),
    "tornado 128k": lambda: tornado(128_000),
    "molecule 5.4k": molecule,
    "pool 10k": pool,
    "dense 120k": lambda: dense(120_000),
}


def camera_rays(balls: meniscus.Balls) -> tuple[np.ndarray, np.ndarray]:
    """The rays of a picture that the balls fill."""
    low, high = balls.positions.min(axis=0).astype(np.float64), balls.positions.max(axis=0).astype(np.float64)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = middle + 1.4 * size * np.array([0.48, -0.76, 0.44])
    camera = meniscus.Camera.perspective(eye, middle, width=WIDTH, height=HEIGHT)
    _, directions = camera.view_rays()
    directions = directions.reshape(-1, 3) @ camera.world_from_view[:3, :3].T
    return np.broadcast_to(eye, directions.shape).copy(), directions


def occlusion_rays(balls: meniscus.Balls, tree: meniscus.FittedBvh, rays: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Sixty-four rays over the hemisphere from each of 4000 points of the surface, lifted off it by a thousandth of R."""
    random = np.random.default_rng(5)
    hits = tree.first_hit(*rays)
    chosen = np.sort(random.choice(np.flatnonzero(hits.balls >= 0), 4000))
    unit = rays[1][chosen] / np.linalg.norm(rays[1][chosen], axis=1, keepdims=True)
    normals = hits.normals[chosen].astype(np.float64)
    lift = 1e-3 * balls.radii[hits.balls[chosen], None].astype(np.float64)
    points = rays[0][chosen] + hits.t[chosen, None] * unit + lift * normals
    directions = random.normal(size=(4000, 64, 3))
    directions *= np.sign(np.einsum("ijk,ik->ij", directions, normals))[..., None]
    return np.repeat(points, 64, axis=0), directions.reshape(-1, 3)


def least_seconds(action: Callable[[], object]) -> float:
    seconds = []
    for _ in range(RUNS):
        begin = time.process_time()
        action()
        seconds.append(time.process_time() - begin)
    return min(seconds)


def measured(balls: meniscus.Balls, rays: tuple, options: Mapping[str, object]) -> tuple[float, float, float, RayCounts]:
    """Milliseconds to build, bytes a ball, million primary rays a second, and what a ray takes."""
    tree = meniscus.FittedBvh(balls, FIELD, **options)
    build = least_seconds(lambda: meniscus.FittedBvh(balls, FIELD, threads=1, **options))
    cast = least_seconds(lambda: tree.first_hit(*rays, threads=1))
    return build * 1e3, tree.bytes / len(balls), len(rays[0]) / cast / 1e6, tree.counts(*rays)


def print_table(title: str, variants: Mapping[str, Mapping[str, object]]) -> None:
    print(f"\n{title}\n")
    print("| scene | balls | tree | build, ms | bytes a ball | million rays a second | nodes | leaves | balls tested |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for scene, make in SCENES.items():
        balls = make()
        rays = camera_rays(balls)
        for name, options in variants.items():
            build, size, speed, counts = measured(balls, rays, options)
            ray = f"{counts.traversals:.2f} | {counts.searches:.2f} | {counts.balls:.1f}"
            print(f"| {scene} | {len(balls)} | {name} | {build:.1f} | {size:.0f} | {speed:.2f} | {ray} |", flush=True)


def print_occlusion() -> None:
    print("\nAmbient occlusion, any hit, unlimited\n")
    print("| scene | million rays a second | occluded |")
    print("| --- | --- | --- |")
    for scene, make in SCENES.items():
        balls = make()
        tree = meniscus.FittedBvh(balls, FIELD)
        rays = occlusion_rays(balls, tree, camera_rays(balls))
        seconds = least_seconds(lambda tree=tree, rays=rays: tree.any_hit(*rays, threads=1))
        print(f"| {scene} | {len(rays[0]) / seconds / 1e6:.2f} | {tree.any_hit(*rays).mean():.2f} |", flush=True)


def main() -> None:
    print_table("BVH and fitted BVH (tables 1 and 3)", {"BVH": OVERLAPPING, "fitted": PAPER, "fitted, proven": OURS})
    print_table("Fitting (table 4)", {"not fitted": PLAIN | {"fits": False}, "fitted": PLAIN})
    refinements = {"none": PLAIN, "tighter boxes": PLAIN | {"tightens": True}, "discarding": PLAIN | {"discards": True}}
    print_table("Refinements (table 5)", refinements | {"both": PAPER})
    print_occlusion()


if __name__ == "__main__":
    main()
