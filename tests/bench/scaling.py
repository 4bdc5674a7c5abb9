"""How methods scale: time against the number of balls, the resolution, the density and the kernel: ``make bench-scaling``.

It also tells which stage of Tile Lists takes how long, and what share of the bandwidth that is with which a buffer is copied.
"""

from __future__ import annotations

import statistics
import time
from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import meniscus
from meniscus.addon.fluid.errors import MeniscusError
from meniscus.addon.fluid.kernels import POLYNOMIAL_KERNELS
from meniscus.addon.render.method import Request
from meniscus.addon.render.registry import create_method, gpu, method_infos
from meniscus.addon.render.settings import checked_settings

from . import machine, report
from .scenes import CROSSINGS, dense_balls, three_quarter_camera

REPEATS = 5
WARM_UP = 2.0
"""Seconds of rendering before what counts on a graphics processor, which needs some to raise its clock."""
COPIED_BYTES = 1 << 26
COPIES = 8


@dataclass(frozen=True)
class Case:
    """What is rendered: balls of one radius in a unit cube, evenly spread or nearly on a lattice.

    Attributes
    ----------
    axis
        Which study it belongs to.
    count, crossings
        Balls, and influence spheres that a ray through the cube crosses.
    size
        Width and height, pixels.
    kernel
        Of the density.
    isovalue
        That is the surface.
    """

    axis: str
    count: int = 100_000
    crossings: float = CROSSINGS
    size: tuple[int, int] = (1920, 1080)
    kernel: str = "wyvill"
    isovalue: float = 0.2

    @property
    def balls(self) -> meniscus.Balls:
        """The balls, the same each time."""
        if self.axis == "dense":
            return dense_balls(self.count)
        positions = np.random.default_rng(1).random((self.count, 3)).astype(np.float32)
        return meniscus.Balls(positions, np.sqrt(self.crossings / (np.pi * self.count)))


def cases(most_balls: int, size: tuple[int, int]) -> Iterator[Case]:
    """All cases of the study."""
    counts = [10**power for power in range(3, 8) if 10**power <= most_balls]
    yield from (Case("balls", count, size=size) for count in counts)
    yield from (Case("thin", count, size=size, isovalue=0.4) for count in counts if count >= 100_000)
    yield from (Case("dense", count, size=size, isovalue=0.4) for count in counts if count >= 100_000)
    sizes = ((320, 240), (640, 480), (1280, 720), (1920, 1080), (3840, 2160))
    yield from (Case("resolution", size=other) for other in sizes if other[0] <= 2 * size[0])
    yield from (Case("density", crossings=crossings, size=size) for crossings in (2, 5, 10, 20, 40))
    yield from (Case("kernel", kernel=kernel, size=size) for kernel in POLYNOMIAL_KERNELS)


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and publish."""
    parser = ArgumentParser(prog="bench-scaling", description="Time methods against balls, resolution, density and kernel.")
    parser.add_argument("--methods", nargs="+", default=[info.name for info in method_infos("metaballs")])
    parser.add_argument("--most-balls", type=int, default=10_000_000)
    parser.add_argument("--size", default="1920x1080", help="of the pictures, WIDTHxHEIGHT")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds after which a method's greater cases are left out")
    parser.add_argument("--update-docs", action="store_true", help="write the report into docs/benchmarks.md")
    options = parser.parse_args(arguments)
    about = machine.describe()
    print(about["warning"], flush=True)
    context = gpu().shared_context()
    about["gl_renderer"] = f"{context.renderer}, {context.gl.info['GL_VERSION']}"
    width, height = map(int, options.size.split("x"))
    rows = measured(list(cases(options.most_balls, (width, height))), options.methods, options.limit)
    bandwidth = copy_bandwidth()
    text = "\n\n".join(
        [report.machine_text(about), time_table(rows, options.methods), stage_table(rows, bandwidth)],
    )
    data = {"machine": about, "bytes_per_second": bandwidth, "rows": rows}
    report.publish("bench-scaling", data, text, options.update_docs)


def measured(wanted: list[Case], methods: list[str], limit: float) -> list[dict[str, Any]]:
    """A row of plain data for each case and method; a method that took longer than the limit gets no case with more balls."""
    rows = []
    slow: dict[str, int] = {}
    for case in wanted:
        balls = case.balls
        for method in methods:
            if case.count >= slow.get(method, case.count + 1):
                continue
            row = measure(case, balls, method)
            rows.append(row)
            print(row, flush=True)
            if row["milliseconds"] is None or row["milliseconds"] > 1e3 * limit:
                slow[method] = case.count
    return rows


def measure(case: Case, balls: meniscus.Balls, method: str) -> dict[str, Any]:
    """Render a case several times: the median of the whole, and the stages of the run that took the median."""
    row: dict[str, Any] = {"axis": case.axis, "value": value_of(case), "method": method, "milliseconds": None}
    try:
        warm_up(case, balls, method)
        runs = [find(case, balls, method) for _ in range(REPEATS)]
    except MeniscusError as error:
        return row | {"error": str(error)}
    middle = statistics.median_low(run[0] for run in runs)
    _, stages, counts = next(run for run in runs if run[0] == middle)
    return row | {"milliseconds": middle, "stages": stages, "counts": counts, "balls": case.count, "size": case.size}


def warm_up(case: Case, balls: meniscus.Balls, method: str) -> None:
    """Render at least once."""
    end = time.perf_counter() + WARM_UP
    find(case, balls, method)
    while create_method(method)[0].backend == "gpu" and time.perf_counter() < end:
        find(case, balls, method)


def find(case: Case, balls: meniscus.Balls, method: str) -> tuple[float, dict[str, float], dict[str, int]]:
    """Find the surface once, on the graphics processor without reading it back: milliseconds, stages, counts."""
    info, runner = create_method(method)
    camera = three_quarter_camera(balls, *case.size)
    field = meniscus.Field(case.kernel, case.isovalue)
    settings = checked_settings(method, info.settings, None)
    request = Request(balls, camera, field, frozenset(), 0, lambda share: None, settings=settings)
    start = time.perf_counter()
    surface = runner.find_surface_on_device(request) if info.backend == "gpu" else runner.find_surface(request)
    spent = 1e3 * (time.perf_counter() - start)
    if info.backend == "gpu":
        surface.release()
    return spent, surface.milliseconds, surface.counts


def value_of(case: Case) -> str:
    """What differs from the study's other cases."""
    size = f"{case.size[0]}x{case.size[1]}"
    values = {"resolution": size, "density": f"{case.crossings:g}", "kernel": case.kernel}
    return values.get(case.axis, f"{case.count:,}")


def copy_bandwidth() -> float:
    """Bytes a second that the graphics processor reads and writes when it copies a buffer."""
    context = gpu().shared_context()

    def copy() -> float:
        source, target = (context.gl.buffer(reserve=COPIED_BYTES) for _ in range(2))
        context.gl.copy_buffer(target, source)
        context.gl.finish()
        start = time.perf_counter()
        for _ in range(COPIES):
            context.gl.copy_buffer(target, source)
        context.gl.finish()
        return 2 * COPIES * COPIED_BYTES / (time.perf_counter() - start)

    return float(context.run(copy))


def time_table(rows: list[dict[str, Any]], methods: list[str]) -> str:
    """Milliseconds of each method."""
    keys = list(dict.fromkeys((row["axis"], row["value"]) for row in rows))
    found = {(row["axis"], row["value"], row["method"]): row["milliseconds"] for row in rows}

    def cell(key: tuple[str, str], method: str) -> str:
        spent = found.get((*key, method))
        return "" if spent is None else report.milliseconds(spent)

    return report.table(["study", "value", *methods], [[*key, *(cell(key, method) for method in methods)] for key in keys])


def stage_table(rows: list[dict[str, Any]], bandwidth: float) -> str:
    """The stages of Tile Lists, and the bytes that it moves at least."""
    timed = [row for row in rows if row["method"] == "tile_lists" and row["milliseconds"] is not None]
    copied = f"Copying a buffer moves {bandwidth / 1e9:.1f} GB/s."
    names = ("occlude", "cull", "bin", "sort", "cast")
    lines = []
    for row in timed:
        stages = row["stages"]
        total = sum(stages[name] for name in names)
        moved = bytes_moved(row)
        share = moved / (total / 1e3) / bandwidth
        times = [report.milliseconds(stages[name]) for name in names]
        lines.append([row["axis"], row["value"], *times, f"{moved / 1e6:.1f}", f"{share:.1%}"])
    headers = ["study", "value", *(f"{name}, ms" for name in names), "MB moved", "of the bandwidth"]
    return f"{copied}\n\n{report.table(headers, lines)}"


def bytes_moved(row: dict[str, Any]) -> float:
    """By a frame of Tile Lists, at least: balls read twice and a sample, seen balls written and read, entries written, sorted
    and read, cells and pixels written.
    """
    width, height = row["size"]
    counts = row["counts"]
    return (
        16 * row["balls"] * (2 + 1 / 16)
        + 32 * 2 * counts["balls_drawn"]
        + 8 * 4 * counts["entries"]
        + width * height * (4 / 16 * 2 + 20)
    )


if __name__ == "__main__":
    main()
