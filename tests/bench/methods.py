"""`make bench-methods`: the table and the pictures of docs/methods.md, in which each method draws the same scene."""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from PIL import Image

import meniscus
from meniscus.addon.fluid.displays import METABALLS
from meniscus.addon.render.method import MethodInfo
from meniscus.addon.render.registry import create_method

from . import machine, report
from .accuracy import FloatArray, field_hits, pixel_grid, pixel_rays
from .scenes import SCENES
from .timing import ALL, Plan, Statistics, interleave, statistics_by_stage, timed

NAME = "methods"
PAGE = report.ROOT / "docs" / "methods.md"
IMAGES = report.ROOT / "docs" / "images"
SCENE = "dam_break"
TIMED_SIZE, PICTURE_SIZE = (640, 480), (320, 240)
FINER = 2
"""Pictures are rendered so many times as large, and then averaged."""
RAYS = 4000
"""About how many pixels are compared with the oracle."""
LOOK = meniscus.Look(style="studio")
BACKGROUND = 0.08
"""Behind the pictures, linear."""
COLORS = 128
"""Of the files."""


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-methods", description="Compare the methods on one scene.")
    parser.add_argument("--repeats", type=int, default=7, help="measured rounds")
    parser.add_argument("--pictures", action="store_true", help="render the pictures of docs/methods.md instead")
    parser.add_argument("--update-docs", action="store_true", help="also put the table into docs/methods.md")
    options = parser.parse_args(arguments)
    runnable = [status.info for status in meniscus.methods() if not status.problem]
    if options.pictures:
        for info in runnable:
            save_picture(info)
        return
    methods = [info for info in runnable if METABALLS in info.displays]
    about = machine.describe() | {"gl_renderer": create_method("glyphs")[1].device}
    print(about["warning"], flush=True)
    text = "\n\n".join([report.machine_text(about), methods_table(methods, Plan(options.repeats))])
    report.publish(NAME, {"machine": about, "text": text}, text, options.update_docs, PAGE)


def methods_table(methods: list[MethodInfo], plan: Plan) -> str:
    """What each method gets wrong, and how long it takes."""
    times = interleave({info.name: timed(drawing(info, TIMED_SIZE)) for info in methods}, plan)
    medians: dict[str, Statistics] = {name: statistics_by_stage(outcome)[ALL] for name, outcome in times.items()}
    fastest = min(medians.values(), key=lambda statistics: statistics.median)
    rows = []
    for info in methods:
        wrong, rms, worst = errors(info)
        median = medians[info.name]
        times_the_fastest = report.ratio(median, fastest)
        numbers = [f"{wrong:.3%}", f"{rms:.1e}", f"{worst:.1e}", report.milliseconds(median.median), times_the_fastest]
        rows.append([info.label, info.backend, *numbers])
        print(rows[-1], flush=True)
    return report.table(["method", "back-end", "wrong pixels", "RMS dt / R", "worst dt / R", "ms", "times the fastest"], rows)


def drawing(info: MethodInfo, size: tuple[int, int]) -> Callable[[], meniscus.ImageBuffers]:
    """Draws depth and normal of the scene with a method."""
    scene = SCENES[SCENE]
    balls = scene.make_balls()
    camera = scene.camera(balls, *size)
    return lambda: meniscus.render(balls, camera, scene.field, method=info.name)


def errors(info: MethodInfo) -> tuple[float, float, float]:
    """Against the oracle: of the pixels that show fluid or should, the share of those that are off by more than 0.02 R or show
    the wrong one of fluid and nothing; RMS and greatest |dt| / R of the rest.
    """
    scene = SCENES[SCENE]
    balls = scene.make_balls()
    camera = scene.camera(balls, *TIMED_SIZE)
    pixels = pixel_grid(camera, RAYS)
    rays, stretch = pixel_rays(camera, pixels)
    true = field_hits(balls, scene.field, rays).t
    depth: FloatArray = drawing(info, TIMED_SIZE)()["depth"].ravel()[pixels].astype(np.float64)
    found = np.where(depth < 1e10, depth * stretch, np.inf)
    concerned = np.isfinite(found) | np.isfinite(true)
    with np.errstate(invalid="ignore"):
        off = np.abs(found - true)[concerned] / float(balls.radii[0])
    right = off[off <= 0.02]
    return 1 - len(right) / len(off), float(np.sqrt(np.mean(right**2))), float(right.max())


def save_picture(info: MethodInfo) -> None:
    """Render the scene with a method into docs/images: as metaballs, or as spheres where it has no others."""
    scene = SCENES[SCENE]
    balls = scene.make_balls()
    width, height = PICTURE_SIZE
    camera = scene.camera(balls, FINER * width, FINER * height)
    display = METABALLS if METABALLS in info.displays else "spheres"
    image = meniscus.render(balls, camera, scene.field, method=info.name, passes=("combined",), look=LOOK, display=display)
    combined = image["combined"][::-1]
    linear = combined[..., :3] + (1 - combined[..., 3:]) * BACKGROUND
    linear = np.clip(linear, 0, 1).reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    path = IMAGES / f"{NAME}_{info.name}.png"
    picture = Image.fromarray(np.rint(255 * encoded).astype(np.uint8))
    picture.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


if __name__ == "__main__":
    main()
