"""`make bench`: Meniscus' own times on the named scenes, by stage, method, processor path and threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from . import fitted_bvh, machine, report
from .options import parser
from .renderers import Picture, Renderers
from .scenes import SCENES
from .timing import Plan, Sample, Statistics, interleave, statistics_by_stage
from .variants import Variant, default_methods, variants

DEFAULT_SCENES = tuple(name for name in SCENES if not name.startswith("block_"))
WHOLE = "render"
"""The stage that is the whole call."""


@dataclass(frozen=True)
class Row:
    """One variant on one picture: milliseconds by stage, and why there are none or no more."""

    picture: Picture
    variant: Variant
    stages: dict[str, Statistics]
    facts: dict[str, Any]
    problem: str


def main(arguments: list[str] | None = None) -> None:
    options_parser = parser("bench", "Time Meniscus on named scenes.", DEFAULT_SCENES, Plan(), 120.0)
    options_parser.add_argument("--method", nargs="+", metavar="NAME", help="the CPU's and, on hardware, OpenGL's if left out")
    options = options_parser.parse_args(arguments)
    about = machine.describe()
    print(about["warning"], flush=True)
    rows = []
    plan = Plan(options.repeats, options.budget)
    with Renderers("bench") as renderers:
        described = renderers.describe()
        about["gl_renderer"] = described["gl_renderer"]
        methods = options.method or default_methods(described)
        for scene in options.scenes:
            chosen = variants(scene, methods, described["simd_paths"])
            for size in options.sizes:
                print(f"{scene} {size[0]}x{size[1]}", flush=True)
                rows += measure(renderers, Picture(scene, *size), chosen, plan, options.limit)
    trees = fitted_bvh.measure(options.scenes, plan, options.limit, report.OUT / "bench.log")
    data = {"machine": about, "options": vars(options), "rows": list(map(asdict, rows)), "trees": list(map(asdict, trees))}
    parts = [report.machine_text(about), table_of(rows)] + ([fitted_bvh.table_of(trees)] if trees else [])
    report.publish("bench", data, "\n\n".join(parts), options.update_docs)


def measure(renderers: Renderers, picture: Picture, chosen: Sequence[Variant], plan: Plan, limit: float) -> list[Row]:
    """Time the variants on a picture in turn."""
    facts: dict[Variant, dict[str, Any]] = {variant: {} for variant in chosen}

    def render(variant: Variant) -> Sample:
        reply = renderers.render(variant, picture, limit)
        milliseconds: Sample = reply.pop("milliseconds")
        facts[variant] = reply
        return milliseconds

    outcomes = interleave({variant: partial(render, variant) for variant in chosen}, plan)
    return [
        Row(picture, variant, statistics_by_stage(outcome), facts[variant], outcome.problem)
        for variant, outcome in outcomes.items()
    ]


def table_of(rows: Sequence[Row]) -> str:
    """A row each; the ratio is to the first variant of the same picture."""
    stages = [stage for stage in dict.fromkeys(stage for row in rows for stage in row.stages) if stage != WHOLE]
    headers = ["scene", "balls", "size", "method", "path", "threads", *stages, f"{WHOLE}()", "ratio"]
    firsts: dict[Picture, Row] = {}
    for row in rows:
        firsts.setdefault(row.picture, row)
    return report.table(headers, [_cells(row, firsts[row.picture], stages) for row in rows])


def _cells(row: Row, first: Row, stages: Sequence[str]) -> list[str]:
    medians = [report.milliseconds(row.stages[stage].median) if stage in row.stages else "" for stage in stages]
    whole = report.median_and_spread(row.stages[WHOLE]) if WHOLE in row.stages else ""
    return [
        row.picture.scene,
        str(row.facts.get("balls", "")),
        f"{row.picture.width}x{row.picture.height}",
        row.variant.method,
        row.variant.simd,
        str(row.variant.threads or "all"),
        *medians,
        "; ".join(filter(None, [whole, row.problem])),
        report.ratio(row.stages.get(WHOLE), first.stages.get(WHOLE)),
    ]


if __name__ == "__main__":
    main()
