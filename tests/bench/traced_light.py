"""Times primary rays, shadows, occlusion and reflections on the graphics processor, by its own timers: ``make bench-light``.

The scenes are like those of Gourmel et al. 2010. Where OpenGL is software the clock is read instead.
"""

from __future__ import annotations

import statistics
from argparse import ArgumentParser
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import meniscus
from meniscus.addon.fluid.lighting import Light, Lighting, Material
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.fitted_bvh import FittedBvh
from meniscus.addon.render.method import Request
from meniscus.addon.render.registry import gpu
from meniscus.gpu_shaders import tree_constants
from meniscus.gpu_shaders.methods.fitted_bvh.method import FittedBvhMethod
from meniscus.gpu_shaders.tracing.stage import TracedFluid, TracedLight

from . import machine
from .report_fitted_bvh import SCENES
from .scenes import SIZES, three_quarter_camera

NAMES = ("pool 10k", "tornado 128k", "molecule 5.4k", "scattered 100k")
FIELD = meniscus.Field("wyvill", 0.2)
SUN = Light("SUN", (3.0, 2.9, 2.8), direction=(-0.5392, 0.5392, -0.6470))
DAY = Lighting((SUN,), world=(0.3, 0.4, 0.6))
OVERCAST = Lighting((), world=(0.8, 0.8, 0.8))
MATT = Material(color=(0.8, 0.5, 0.3))
WATER = Material(color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.33, absorption=(0.9, 0.3, 0.1))
MERCURY = Material(color=(0.8, 0.8, 0.85), roughness=0.0, metallic=1.0)
# What light does, and how far it is followed. "mirror 3" has no refraction: what a dark body mirrors is mirrored three times.
STUDIES: Mapping[str, tuple[Material, Lighting, Tracing]] = {
    "shadows": (MATT, DAY, Tracing(reflections=0)),
    "occlusion 64": (MATT, OVERCAST, Tracing(reflections=0, occlusion_rays=64)),
    "Fresnel, mirror 3, shadows": (Material(color=(0.05, 0.1, 0.15), roughness=0.0, ior=1.33), DAY, Tracing(reflections=3)),
    "mercury, mirror 3, shadows": (MERCURY, DAY, Tracing(reflections=3)),
    "water, mirror 3, 8 passages": (WATER, DAY, Tracing(reflections=3, refractions=8)),
}


@dataclass(frozen=True)
class Row:
    """Medians, milliseconds.

    Attributes
    ----------
    scene, memory, study
        What was timed.
    size
        Width and height, pixels.
    milliseconds, rays
        Of an image, and million pixels with a surface, each times the rays that are asked of it first.
    """

    scene: str
    memory: str
    study: str
    size: tuple[int, int]
    milliseconds: float
    rays: float


def median(samples: list[float]) -> float:
    """Without the first, which compiles and uploads."""
    return statistics.median(samples[1:] or samples)


def measured(name: str, size: tuple[int, int], repeats: int, studies: tuple[str, ...], with_storage: bool) -> Iterator[Row]:
    """All studies of a scene at one size."""
    context = gpu().shared_context()
    balls = SCENES[name]()
    camera = three_quarter_camera(balls, *size)
    request = Request(balls, camera, FIELD, frozenset(), 0, lambda _: None)
    memory = "storage" if with_storage else "textures"
    for hierarchy in ("overlapping", "fitted"):
        method = FittedBvhMethod(context, hierarchy, with_storage)
        surfaces = [method.find_surface_on_device(request) for _ in range(repeats + 1)]
        cast = median([surface.milliseconds["cast"] for surface in surfaces])
        yield Row(name, memory, f"primary, {hierarchy}", size, cast, size[0] * size[1] / 1e6)
    surface = surfaces[-1]
    hits = float((surface.read_back()["depth"] < 1e9).sum()) / 1e6
    tree = FittedBvh(balls, FIELD).arrays()
    for study in studies:
        material, lighting, tracing = STUDIES[study]
        stage, fluid = TracedLight(context, with_storage), TracedFluid(tree, balls, FIELD, (material,))
        spent = []
        for _ in range(repeats + 1):
            surface.milliseconds.clear()
            context.run(partial(stage.trace, surface, camera, fluid, lighting, tracing))
            spent.append(surface.milliseconds["trace"])
        yield Row(name, memory, study, size, median(spent), hits * max(tracing.occlusion_rays, 1))


def main() -> None:
    """Measure what the command line asks for, and print a table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=NAMES, choices=list(SCENES))
    parser.add_argument("--size", nargs="+", default=[f"{width}x{height}" for width, height in SIZES])
    parser.add_argument("--studies", nargs="+", default=list(STUDIES), choices=list(STUDIES))
    parser.add_argument("--memory", nargs="+", default=["storage", "textures"], choices=["storage", "textures"])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--met-length", type=int, default=tree_constants.MET_LENGTH, help="balls of a leaf that are kept")
    options: Any = parser.parse_args()
    tree_constants.MET_LENGTH = options.met_length
    found = machine.describe()
    print(f"{gpu().shared_context().renderer}; {found['processor']}, {found['cores']} cores. {found['warning']}\n")
    print("| scene | size | memory | study | ms | million rays a second |")
    print("| --- | --- | --- | --- | --- | --- |")
    for size in options.size:
        width, height = (int(side) for side in size.split("x"))
        for name in options.scenes:
            for memory in options.memory:
                for row in measured(name, (width, height), options.repeats, tuple(options.studies), memory == "storage"):
                    speed = row.rays / row.milliseconds * 1e3 if row.milliseconds else 0.0
                    print(f"| {name} | {size} | {memory} | {row.study} | {row.milliseconds:.2f} | {speed:.0f} |", flush=True)


if __name__ == "__main__":
    main()
