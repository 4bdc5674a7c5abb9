"""`make bench-pictures`: the pictures of docs/kanamori_2008.md, rendered anew."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

import meniscus
from meniscus.samples import dam_break

from . import figure_2
from .report import ROOT
from .scenes import SCENES, Point

FloatArray = npt.NDArray[np.float64]
Faces = tuple[FloatArray, npt.NDArray[np.int64]]
"""(height, width) planar depths, infinite where there is no face, and the axis that the face is square to."""

FOLDER = ROOT / "docs" / "images"
SIZE = (640, 480)
FINER = 2
"""Pictures are rendered so many times as large, and then averaged."""
METHOD = "tile_caster"
SKY = np.array([0.80, 0.84, 0.88])
"""Behind everything, linear Rec.709."""
STONE, WOOD = np.array([0.42, 0.40, 0.37]), np.array([0.30, 0.20, 0.13])
FACE_LIGHT = (0.62, 0.80, 1.0)
"""How light the faces of a box are that are square to x, y and z."""
BASIN_RADIUS = 1.9
"""Of the basin under the jets, Blender units."""
SPHERES = meniscus.Field("power_1", 1e-3)
"""A field so steep that balls hardly blend: the union of their influence spheres, to a thousandth of R."""
HEADLIGHT = meniscus.Look(style="headlight")
DEPTH_CONTRAST = 3.0
"""Of figure 11's enhanced picture."""
COLORS = 256
"""Of the files: the pictures have few hues, and are a third as large that way."""


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-pictures", description="Render the pictures of docs/kanamori_2008.md.")
    parser.add_argument("--only", nargs="+", choices=PICTURES, default=list(PICTURES), metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="docs/images if left out")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        path = options.output / f"kanamori_2008_{name}.png"
        PICTURES[name]().quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
        print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


def _plain(scene: str, **instead: Any) -> Image.Image:
    """A scene before the sky; see `_fluid`."""
    return _displayed(_over(_fluid(scene, **instead), _sky()))


def _spheres(scene: str) -> Image.Image:
    """Its balls as spheres that do not blend, as large as they are alone."""
    balls, field = _balls(scene), SCENES[scene].field
    spheres = meniscus.Balls(balls.positions, field.kernel_radii(balls.radii, balls.weights), colors=balls.colors)
    return _plain(scene, balls=spheres, field=SPHERES)


def _tank(scene: str) -> Image.Image:
    """The liquid in its tank, of which only the faces behind the liquid are shown, with the pillar."""
    image, camera, background = _fluid(scene), _camera(scene), _sky()
    _, (depth, axis) = _box(camera, (0.0, 0.0, 0.0), dam_break.TANK)
    _paint(background, np.isfinite(depth), STONE, axis)
    picture = _over(image, background)
    (depth, axis), _ = _box(camera, dam_break.PILLAR_LOW, dam_break.PILLAR_HIGH)
    _paint(picture, depth < image["depth"], WOOD, axis)
    return _displayed(picture)


def _basin(scene: str) -> Image.Image:
    """The jets above their basin's floor."""
    background = _sky()
    origin, directions = _rays(_camera(scene))
    depth = -origin[2] / directions[..., 2]
    on_floor = origin[:2] + depth[..., None] * directions[..., :2]
    background[(depth > 0) & (np.hypot(on_floor[..., 0], on_floor[..., 1]) < BASIN_RADIUS)] = STONE
    return _displayed(_over(_fluid(scene), background))


def _figure_2() -> Image.Image:
    return figure_2.draw(_balls("kanamori_figure_2"), SCENES["kanamori_figure_2"].field)


@cache
def _balls(scene: str) -> meniscus.Balls:
    return SCENES[scene].make_balls()


def _camera(scene: str) -> meniscus.Camera:
    return SCENES[scene].camera(_balls(scene), FINER * SIZE[0], FINER * SIZE[1])


def _fluid(scene: str, **instead: Any) -> meniscus.ImageBuffers:
    """The picture of a scene; other arguments of `meniscus.render` may take the place of its own."""
    settings = {
        "balls": _balls(scene),
        "camera": _camera(scene),
        "field": SCENES[scene].field,
        "method": METHOD,
        "look": HEADLIGHT,
        **instead,
    }
    return meniscus.render(passes=("combined", "depth"), **settings)


def _sky() -> FloatArray:
    return np.tile(SKY, (FINER * SIZE[1], FINER * SIZE[0], 1))


def _over(image: meniscus.ImageBuffers, background: FloatArray) -> FloatArray:
    combined = image["combined"].astype(np.float64)
    over: FloatArray = combined[..., :3] + (1 - combined[..., 3:]) * background
    return over


def _paint(picture: FloatArray, where: npt.NDArray[np.bool_], color: FloatArray, axis: npt.NDArray[np.int64]) -> None:
    """Paint faces of a box that are square to an axis each."""
    picture[where] = color * np.array(FACE_LIGHT)[axis[where], None]


def _rays(camera: meniscus.Camera) -> tuple[FloatArray, FloatArray]:
    """The eye, and (height, width, 3) directions in world space; their unit of length is planar depth."""
    _, directions = camera.view_rays()
    return np.asarray(camera.eye, np.float64), directions @ camera.world_from_view[:3, :3].T


def _box(camera: meniscus.Camera, low: Point, high: Point) -> tuple[Faces, Faces]:
    """Where rays enter and where they leave a box between two corners."""
    origin, directions = _rays(camera)
    ends = (np.stack([low, high]) - origin)[:, None, None] / directions
    enter, leave = ends.min(axis=0), ends.max(axis=0)
    meets = enter.max(axis=-1) < leave.min(axis=-1)
    return (
        (np.where(meets, enter.max(axis=-1), np.inf), enter.argmax(axis=-1)),
        (np.where(meets, leave.min(axis=-1), np.inf), leave.argmin(axis=-1)),
    )


def _displayed(picture: FloatArray) -> Image.Image:
    """From linear Rec.709, row 0 at the bottom, to 8-bit sRGB (IEC 61966-2-1) of SIZE."""
    linear = np.clip(picture[::-1], 0.0, 1.0).reshape(SIZE[1], FINER, SIZE[0], FINER, 3).mean(axis=(1, 3))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.rint(255 * encoded).astype(np.uint8))


PICTURES: dict[str, Callable[[], Image.Image]] = {
    "figure_1": partial(_plain, "kanamori_figure_1"),
    "figure_2": _figure_2,
    "table_1_10k": partial(_plain, "kanamori_table_1_10k"),
    "table_1_100k": partial(_plain, "kanamori_table_1_100k"),
    "figure_10_whole": partial(_tank, "kanamori_figure_10_whole"),
    "figure_10_close": partial(_tank, "kanamori_figure_10_close"),
    "figure_11_spheres": partial(_spheres, "kanamori_figure_11"),
    "figure_11_metaballs": partial(_plain, "kanamori_figure_11"),
    "figure_11_enhanced": partial(_plain, "kanamori_figure_11", look=replace(HEADLIGHT, depth_contrast=DEPTH_CONTRAST)),
    "figure_12_early": partial(_basin, "kanamori_figure_12_early"),
    "figure_12_full": partial(_basin, "kanamori_figure_12_full"),
}

if __name__ == "__main__":
    main()
