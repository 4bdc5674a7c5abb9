"""`make bench-mueller`: the experiments of Mueller, Grottel and Ertl 2007, the paper's figures beside ours."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np
from PIL import Image

import meniscus
from meniscus.addon.render.method import MethodInfo
from meniscus.addon.render.neighbours import find_neighbours
from meniscus.addon.render.registry import create_method, method_infos

from . import machine, report
from .mueller_scenes import DATA_SETS, FIELD, DataSet
from .timing import Plan, repeated

NAME = "mueller-2007"
PAGE = report.ROOT / "docs" / "mueller_2007.md"
IMAGES = report.ROOT / "docs" / "images"
PAPER_METHODS = ("vicinity", "walking_depth_plane")
"""The paper's methods; those that are registered are measured."""
SIZE = 512
"""Width and height of the images, as in the paper."""
FIGURE_4 = {"10 samples": (10, 0), "10 samples, 4 bisections": (10, 4), "50 samples": (50, 0)}
"""Samples and bisections."""
FIGURE_4_SIZE = 320
GREATEST_ERROR = 0.01
"""That is white in the lower row of figure 4, influence radii."""
SURFACE_SHARE = 0.7
"""Of the pictures of figure 4: what is farther than this share of the depths is black."""
COLORS = 256


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="make bench-mueller", description="Time the methods of a paper on its data sets.")
    names = list(DATA_SETS)
    parser.add_argument("--scenes", nargs="+", choices=names, default=names, metavar="NAME", help=", ".join(names))
    parser.add_argument("--repeats", type=int, default=7, help="measured rounds of a case")
    parser.add_argument("--size", type=int, default=SIZE, help="width and height of the images, pixels")
    parser.add_argument("--pictures", action="store_true", help="render the pictures of docs/mueller_2007.md instead")
    parser.add_argument("--update-docs", action="store_true", help="also put the tables into docs/mueller_2007.md")
    options = parser.parse_args(arguments)
    if options.pictures:
        for name in options.scenes:
            save_picture(name)
        save_figure_4()
        return
    methods = [info for info in method_infos() if info.name in PAPER_METHODS]
    device = create_method(methods[0].name)[1].device
    about = machine.describe() | {"gl_renderer": device}
    print(about["warning"], flush=True)
    plan = Plan(options.repeats)
    sets = [DATA_SETS[name] for name in options.scenes]
    tables = [list_table(sets, plan), group_table(sets), *(frame_table(info, sets, plan, options.size) for info in methods)]
    text = "\n\n".join([report.machine_text(about), *tables])
    report.publish(NAME, {"machine": about, "text": text}, text, options.update_docs, PAGE)


def list_table(sets: list[DataSet], plan: Plan) -> str:
    """Table 1, processing time: how long the lists take."""
    rows = []
    for data_set in sets:
        balls = data_set.balls()
        best = repeated(partial(find_neighbours, balls), plan).least
        paper = data_set.paper.milliseconds
        times = f"{float(paper) / best:.0f}" if paper.isdigit() else ""
        rows.append([data_set.label, f"{len(balls):,}", paper, report.milliseconds(best), times])
        print(rows[-1], flush=True)
    return report.table(["data set", "balls", "paper, ms", "ours, ms (best)", "times faster"], rows)


def group_table(sets: list[DataSet]) -> str:
    """Table 2: how many neighbours balls have."""
    rows = []
    for data_set in sets:
        counts = find_neighbours(data_set.balls()).counts
        some = counts[counts > 0]
        ours = len(some), len(counts) - len(some), int(some.min()), float(some.mean()), int(some.max())
        rows.append([data_set.label, groups_text(data_set.paper.groups), groups_text(ours)])
    return report.table(["data set", "paper: with, without; least/mean/most", "ours"], rows)


def groups_text(groups: tuple[int, int, int, float, int]) -> str:
    with_some, with_none, fewest, mean, most = groups
    return f"{with_some:,}, {with_none:,}; {fewest}/{mean:.1f}/{most}"


def frame_table(info: MethodInfo, sets: list[DataSet], plan: Plan, size: int) -> str:
    """Tables 1 and 3: images a second, when the lists are there."""
    rows = []
    for data_set in sets:
        balls = data_set.balls()
        camera = data_set.camera(balls, size)
        draw = partial(meniscus.render, balls, camera, FIELD, method=info.name)
        frames = 1e3 / repeated(draw, plan).least
        image = draw()
        paper = data_set.paper.frames[info.name]
        rows.append([data_set.label, f"{paper:g}", f"{frames:.2g}", f"{frames / paper:.2g}", f"{image.hit.mean():.0%}"])
        print(info.name, rows[-1], flush=True)
    headers = [info.label, "paper, images a second", "ours", "times the paper's", "of the image covered"]
    return report.table(headers, rows)


def save_picture(name: str) -> None:
    """Render a data set into docs/images."""
    data_set = DATA_SETS[name]
    balls = data_set.balls()
    camera = data_set.camera(balls, 2 * FIGURE_4_SIZE)
    image = meniscus.render(balls, camera, FIELD, method="tile_caster", passes=("combined",), look=meniscus.Look())
    save(shown(image["combined"][::-1, :, :3] + (1 - image["combined"][::-1, :, 3:]) * 0.9), name)


def shown(linear: Any) -> Any:
    """Half the size, as it is shown."""
    linear = np.clip(linear, 0, 1)
    linear = linear.reshape(linear.shape[0] // 2, 2, linear.shape[1] // 2, 2, 3).mean(axis=(1, 3))
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def save_figure_4() -> None:
    """Distances with few and many samples, and below how wrong they are."""
    data_set = DATA_SETS["sim_3"]
    balls = data_set.balls()
    camera = data_set.camera(balls, FIGURE_4_SIZE)
    exact = meniscus.render(balls, camera, FIELD, method="vicinity", settings={"exact": True})
    near = float(exact["depth"][exact.hit].min())
    far = float(np.quantile(exact["depth"][exact.hit], SURFACE_SHARE))
    columns = []
    for label, (samples, bisections) in FIGURE_4.items():
        settings = {"samples": samples, "bisections": bisections}
        image = meniscus.render(balls, camera, FIELD, method="vicinity", settings=settings)
        both = image.hit & exact.hit
        error = np.where(both, np.abs(image["depth"] - exact["depth"]), 0) / balls.radii[0]
        print(
            f"{label}: {np.count_nonzero(image.hit != exact.hit)} pixels hit or miss wrongly, "
            f"|dt| / R median {np.median(error[both]):.1e}, RMS {np.sqrt(np.mean(error[both] ** 2)):.1e}, "
            f"more than 0.02 for {np.count_nonzero(error > 0.02)}",
            flush=True,
        )
        distance = np.where(image.hit, 1 - 0.9 * np.clip((image["depth"] - near) / (far - near), 0, 1), 0)
        columns.append(np.concatenate([distance[::-1], np.clip(error[::-1] / GREATEST_ERROR, 0, 1)]))
    save(np.repeat(np.concatenate(columns, axis=1)[..., None], 3, axis=2), "figure_4")


def save(encoded: Any, name: str) -> None:
    path = IMAGES / f"{NAME.replace('-', '_')}_{name}.png"
    picture = Image.fromarray(np.rint(255 * encoded).astype(np.uint8))
    picture.quantize(COLORS, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path} {path.stat().st_size / 1024:.0f} KiB", flush=True)


if __name__ == "__main__":
    main()
