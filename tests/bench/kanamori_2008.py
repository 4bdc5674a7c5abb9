"""The experiments of Kanamori, Szego and Nishita 2008: the paper's times beside ours, and what each optimisation is worth."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from . import report
from .measure import WHOLE, Row, measure
from .renderers import Picture, Renderers
from .scenes import SCENES
from .timing import Plan, Statistics
from .variants import Variant

NAME = "kanamori-2008"
PAGE = report.ROOT / "docs" / "kanamori_2008.md"
SCENE_NAMES = tuple(name for name in SCENES if name.startswith("kanamori"))
SIMULATED = ("kanamori_figure_10_whole", "kanamori_figure_10_close")
"""Scenes of one fluid that Blender has to simulate the first time."""
REPEATS, BUDGET = 3, 25.0
"""At most so many measured rounds of a picture, and so many seconds of them: in software a frame takes a second or more."""


@dataclass(frozen=True)
class Case:
    """A picture of the paper.

    Attributes
    ----------
    label
        Where it is in the paper.
    gpu, cpu
        Milliseconds that the paper reports for its methods, from its frames a second where it gives those; None where it
        does not say.
    """

    label: str
    picture: Picture
    gpu: float
    cpu: float | None = None


def _table_1(count: int, width: int, height: int, cpu: float, gpu: float) -> Case:
    return Case("table 1", Picture(f"kanamori_table_1_{count}k", width, height), gpu, cpu)


def _figure(name: str, frames_a_second: float) -> Case:
    label = name.replace("_", " ")
    return Case(label, Picture(f"kanamori_{name}", 640, 480), round(1000 / frames_a_second, 1))


CASES = (
    _figure("figure_1", 23.1),
    _table_1(10, 640, 480, 589.5, 117.1),
    _table_1(50, 640, 480, 1014.8, 191.6),
    _table_1(100, 640, 480, 1469.5, 299.4),
    _table_1(200, 640, 480, 2265.4, 523.6),
    _table_1(10, 1024, 768, 1455.8, 230.4),
    _table_1(50, 1024, 768, 2495.2, 366.3),
    _table_1(100, 1024, 768, 3593.9, 571.4),
    _table_1(200, 1024, 768, 5491.3, 980.4),
    _figure("figure_10_whole", 4.7),
    _figure("figure_10_close", 4.4),
    _figure("figure_11", 22.9),
    _figure("figure_12_early", 6.2),
    _figure("figure_12_full", 2.3),
)
"""On a GeForce 8800 Ultra, and on four threads of a Core 2 Quad at 2.66 GHz; table 1 is without shading."""

GPU, CPU = Variant("depth_peeling"), Variant("tile_caster")
SWITCHES = ("tight_rectangles", "kernel_spheres", "group_queries", "ball_culling", "tiling", "short_stack")
"""The optimisations: fields of `gpu_shaders.methods.depth_peeling.options.Options`."""
WITHOUT = {name: Variant("depth_peeling", switches=((name, False),)) for name in SWITCHES}
COUNTING = Variant("depth_peeling", switches=(("diagnostics", True),))
SWITCHED_SCENES = ("kanamori_table_1_10k", "kanamori_table_1_100k", "kanamori_figure_10_whole", "kanamori_figure_11")
SWITCHED_SIZE = (640, 480)


def run(scenes: Collection[str], about: dict[str, Any], repeats: int, limit: float, update_docs: bool) -> None:
    """Measure the cases of the chosen scenes and publish the tables; see `run_bench`."""
    cases = [case for case in CASES if case.picture.scene in scenes]
    simulated = [scene for scene in SIMULATED if scene in scenes]
    if simulated:
        print("figure 10: Blender simulates the fluid the first time, which takes ten to fifteen minutes", flush=True)
        SCENES[simulated[0]].make_balls()
    plan = Plan(min(repeats, REPEATS), BUDGET)
    rows: list[Row] = []
    switched: list[Row] = []
    with Renderers("bench") as renderers:
        for case in cases:
            picture = case.picture
            print(f"{picture.scene} {picture.width}x{picture.height}", flush=True)
            rows += measure(renderers, picture, (GPU, CPU), plan, limit)
        for picture in (Picture(scene, *SWITCHED_SIZE) for scene in SWITCHED_SCENES if scene in scenes):
            print(f"{picture.scene} without optimisations", flush=True)
            switched += measure(renderers, picture, (GPU, *WITHOUT.values()), plan, limit)
            switched += measure(renderers, picture, (COUNTING,), Plan(0, 0.0), limit)
    parts = [report.machine_text(about), times_table(cases, rows)]
    if switched:
        parts += [switches_table(switched), counts_table(switched)]
    data = {
        "machine": about,
        "cases": list(map(asdict, cases)),
        "rows": list(map(asdict, rows)),
        "switched": list(map(asdict, switched)),
    }
    report.publish(NAME, data, "\n\n".join(parts), update_docs, PAGE)


Found = dict[tuple[Picture, Variant], Row]


def times_table(cases: Sequence[Case], rows: Sequence[Row]) -> str:
    """A row for each case; how many times as fast ours is as the paper's, and Depth Peeling's time by the Tile Caster's."""
    found = _by_picture(rows)
    faster = "times as fast"
    headers = ["paper", "scene", "balls", "size", "its GPU", "Depth Peeling", faster, "its CPU", "Tile Caster", faster]
    headers.append("Depth Peeling by Tile Caster")
    return report.table(headers, [_times(case, found) for case in cases])


def _times(case: Case, found: Found) -> list[str]:
    gpu, cpu = found[case.picture, GPU], found[case.picture, CPU]
    return [
        case.label,
        case.picture.scene,
        str(cpu.facts.get("balls", "")),
        f"{case.picture.width}x{case.picture.height}",
        f"{case.gpu:.1f}",
        _cell(gpu),
        report.ratio(_once(case.gpu), _whole(gpu)),
        "" if case.cpu is None else f"{case.cpu:.1f}",
        _cell(cpu),
        report.ratio(_once(case.cpu), _whole(cpu)),
        report.ratio(_whole(gpu), _whole(cpu)),
    ]


def _by_picture(rows: Sequence[Row]) -> Found:
    return {(row.picture, row.variant): row for row in rows}


def switches_table(measured: Sequence[Row]) -> str:
    """A row for each optimisation, a column for each scene: milliseconds without it, and how many times as long that is."""
    found = _by_picture(measured)
    pictures = list(dict.fromkeys(row.picture for row in measured))
    rows = [["all switched on", *(_cell(found[picture, GPU]) for picture in pictures)]]
    for name, variant in WITHOUT.items():
        rows.append([f"without {name}", *(_without(found[picture, variant], found[picture, GPU]) for picture in pictures)])
    return report.table(["Depth Peeling", *(picture.scene for picture in pictures)], rows)


def _without(row: Row, whole: Row) -> str:
    ratio = report.ratio(_whole(row), _whole(whole))
    return f"{_cell(row)}, x {ratio}" if ratio else _cell(row)


def counts_table(rows: Sequence[Row]) -> str:
    """A row for each scene: what the culling leaves, and the steps of Bezier clipping."""
    headers = ["scene", "balls", "kept by culling", "share", "iterations of Bezier clipping, mean", "greatest"]
    return report.table(headers, [_counts(row) for row in rows if row.variant == COUNTING])


def _counts(row: Row) -> list[str]:
    counts: dict[str, int] = row.facts.get("counts", {})
    if not counts:
        return [row.picture.scene, "", row.problem, "", "", ""]
    kept, balls, solves = counts["balls_kept"], row.facts["balls"], max(counts["bezier_solves"], 1)
    mean = counts["bezier_iterations"] / solves
    return [
        row.picture.scene,
        str(balls),
        str(kept),
        f"{kept / balls:.0%}",
        f"{mean:.2f}",
        str(counts["bezier_iterations_max"]),
    ]


def _whole(row: Row) -> Statistics | None:
    return row.stages.get(WHOLE)


def _cell(row: Row) -> str:
    whole = _whole(row)
    return "; ".join(filter(None, [report.median_and_spread(whole) if whole else "", row.problem]))


def _once(value: float | None) -> Statistics | None:
    """A time that the paper reports."""
    return None if value is None else Statistics(value, value, value, value, value, 1)
