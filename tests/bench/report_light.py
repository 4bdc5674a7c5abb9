"""Prints the table of docs/light.md: .venv/bin/python tests/bench/report_light.py

Traced light on scenes like those of Gourmel et al. 2010, at their 640x480: how long an image takes, from the balls to Combined,
once the tree is built. Medians of several runs, beside the same image without traced light.
"""

from __future__ import annotations

import statistics
import time

import numpy as np
import report_fitted_bvh

import meniscus
from meniscus.addon.fluid.lighting import FluidSource, Light, Lighting, Material
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.surroundings import Backdrop

RUNS = 5

LIGHTING = Lighting((Light("SUN", (3.0, 3.0, 2.8), direction=(-0.48, 0.6, -0.64)),), (0.35, 0.45, 0.6))
WATER = Material((0.9, 0.95, 1.0), roughness=0.0, transmission=1.0, ior=1.33, absorption=(1.5, 0.4, 0.2))
MATT = Material((0.8, 0.3, 0.2), roughness=1.0, ior=1.0)
MERCURY = Material((0.8, 0.8, 0.85), roughness=0.0, metallic=1.0)

# The scene, the effects, the material and how far light is followed.
ROWS = (
    ("tornado 4k", "hard shadows, 1 reflection", MERCURY, Tracing(reflections=1)),
    ("tornado 128k", "hard shadows, 1 reflection", MERCURY, Tracing(reflections=1)),
    ("tornado 128k", "hard shadows, 3 reflections", MERCURY, Tracing(reflections=3)),
    ("molecule 5.4k", "64 occlusion rays", MATT, Tracing(shadows=False, occlusion_rays=64)),
    ("molecule 5.4k", "64 occlusion rays, hard shadows", MATT, Tracing(occlusion_rays=64)),
    ("pool 10k", "hard shadows, 3 reflections", MERCURY, Tracing(reflections=3)),
    ("pool 10k", "water: 3 reflections, 8 refractions, tinted shadows", WATER, Tracing()),
    ("scattered 30k", "hard shadows, 1 reflection", MERCURY, Tracing(reflections=1)),
    ("scattered 100k", "hard shadows, 1 reflection", MERCURY, Tracing(reflections=1)),
)


def camera_of(balls: meniscus.Balls) -> meniscus.Camera:
    """The camera of :func:`report_fitted_bvh.camera_rays`."""
    low, high = balls.positions.min(axis=0).astype(np.float64), balls.positions.max(axis=0).astype(np.float64)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = middle + 1.4 * size * np.array([0.48, -0.76, 0.44])
    return meniscus.Camera.perspective(eye, middle, width=report_fitted_bvh.WIDTH, height=report_fitted_bvh.HEIGHT)


def image_of(balls: meniscus.Balls, camera: meniscus.Camera, material: Material, tracing: Tracing | None) -> np.ndarray:
    sources = (FluidSource(material=material),)
    look = meniscus.Look("material", color=material.color, sources=sources, lighting=LIGHTING, tracing=tracing)
    field, behind = report_fitted_bvh.FIELD, Backdrop.empty(camera, (*LIGHTING.world, 1.0))
    image = meniscus.render(balls, camera, field, passes=("combined",), look=look, backend="cpu", backdrop=behind)
    return image["combined"]


def median_seconds(balls: meniscus.Balls, camera: meniscus.Camera, material: Material, tracing: Tracing | None) -> float:
    image_of(balls, camera, material, tracing)
    seconds = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        image_of(balls, camera, material, tracing)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


def main() -> None:
    print("| scene | effects | milliseconds | images a second | without traced light, ms |")
    print("| --- | --- | --- | --- | --- |")
    for scene, effects, material, tracing in ROWS:
        balls = report_fitted_bvh.SCENES[scene]()
        camera = camera_of(balls)
        traced, plain = (median_seconds(balls, camera, material, each) for each in (tracing, None))
        print(f"| {scene} | {effects} | {traced * 1e3:.0f} | {1 / traced:.1f} | {plain * 1e3:.0f} |", flush=True)


if __name__ == "__main__":
    main()
