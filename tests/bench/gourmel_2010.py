"""`make bench-gourmel`: the experiments of Gourmel et al. 2010 with traced light, the paper's frames a second beside ours."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

import meniscus
from meniscus.addon.fluid.tracing import Tracing

from . import machine, report
from .gourmel_scenes import EFFECTS, FIELD, PAPER_EFFECTS, SCENES, Scene
from .timing import Plan, repeated

NAME = "gourmel-2010"
PAGE = report.ROOT / "docs" / "gourmel_2010.md"
IMAGES = report.ROOT / "docs" / "images"
METHOD = "tile_caster"
SIZE = (640, 480)
PICTURE_SAMPLES = 4
"""Of each pixel of a picture, so that soft light has little noise."""
FINER = 2
"""Pictures are rendered so many times as large, and then averaged."""
COLORS = 256


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-gourmel", description="Time traced light on the scenes of a paper.")
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES), metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--repeats", type=int, default=7, help="measured rounds of a case")
    parser.add_argument("--pictures", action="store_true", help="render the pictures of docs/gourmel_2010.md instead")
    parser.add_argument("--update-docs", action="store_true", help="also put the tables into docs/gourmel_2010.md")
    options = parser.parse_args(arguments)
    if options.pictures:
        for name in options.scenes:
            save_picture(name)
        return
    about = machine.describe() | {"gl_renderer": "not used"}
    print(about["warning"], flush=True)
    plan = Plan(options.repeats)
    effects = [name for name in PAPER_EFFECTS if name in options.scenes]
    text = "\n\n".join([report.machine_text(about), scene_table(options.scenes, plan), effect_table(effects, plan)])
    report.publish(NAME, {"machine": about, "text": text}, text, options.update_docs, PAGE)


def scene_table(names: list[str], plan: Plan) -> str:
    """Table 1: each scene with its effects."""
    rows = []
    for name in names:
        scene = SCENES[name]
        balls = scene.balls()
        build = repeated(partial(meniscus.FittedBvh, balls, FIELD), plan).median
        frames = 1e3 / repeated(shot(scene, balls, scene.tracing), plan).median
        paper_bvh, paper = scene.paper
        numbers = [f"{paper_bvh:g}", f"{paper:g}", f"{build:.1f}", f"{frames:.1f}", f"{frames / paper:.1f}"]
        rows.append([scene.label, f"{len(balls):,}", *numbers])
        print(rows[-1], flush=True)
    headers = ["scene", "balls", "paper, BVH", "paper, fitted", "our tree, ms", "ours", "times the paper's"]
    return report.table(headers, rows)


def effect_table(names: list[str], plan: Plan) -> str:
    """Table 2: what each effect costs."""
    rows = []
    for name in names:
        scene = SCENES[name]
        balls = scene.balls()
        for (effect, tracing), paper in zip(EFFECTS.items(), PAPER_EFFECTS[name], strict=True):
            frames = 1e3 / repeated(shot(scene, balls, tracing), plan).median
            rows.append([scene.label.partition(",")[0], effect, f"{paper:g}", f"{frames:.1f}", f"{frames / paper:.1f}"])
            print(rows[-1], flush=True)
    return report.table(["scene", "effects", "paper", "ours", "times the paper's"], rows)


def shot(scene: Scene, balls: meniscus.Balls, tracing: Tracing | None) -> Callable[[], Any]:
    """Renders the Combined pass once; the tree and what is behind the fluid are there."""
    camera = scene.camera(balls, *SIZE)
    look = replace(scene.look, tracing=tracing)
    surroundings = scene.surroundings(camera)
    return lambda: meniscus.render(balls, camera, FIELD, method=METHOD, passes=("combined",), look=look, backdrop=surroundings)


def save_picture(name: str) -> None:
    """Render a scene without noise into docs/images."""
    scene = SCENES[name]
    balls = scene.balls()
    camera = scene.camera(balls, FINER * SIZE[0], FINER * SIZE[1])
    tracing = scene.tracing and replace(scene.tracing, samples=1 if scene.tracing.occlusion_rays else PICTURE_SAMPLES)
    look = replace(scene.look, tracing=tracing)
    image = meniscus.render(
        balls, camera, FIELD, method=METHOD, passes=("combined",), look=look, backdrop=scene.surroundings(camera)
    )
    linear = np.clip(image["combined"][::-1, :, :3], 0.0, 1.0)
    linear = linear.reshape(SIZE[1], FINER, SIZE[0], FINER, 3).mean(axis=(1, 3))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    path = IMAGES / f"{NAME.replace('-', '_')}_{name}.png"
    picture = Image.fromarray(np.rint(255 * encoded).astype(np.uint8))
    picture.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


if __name__ == "__main__":
    main()
