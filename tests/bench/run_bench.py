"""`make bench`: Meniscus' own times on the named scenes, by stage, method, processor path and threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from . import fitted_bvh, kanamori_2008, machine, report
from .measure import WHOLE, Row, measure
from .options import parser
from .renderers import Picture, Renderers
from .scenes import SCENES
from .timing import Plan
from .variants import default_methods, variants

DEFAULT_SCENES = tuple(name for name in SCENES if not name.startswith("block_"))


def main(arguments: list[str] | None = None) -> None:
    options_parser = parser("bench", "Time Meniscus on named scenes.", DEFAULT_SCENES, Plan(), 120.0)
    options_parser.add_argument("--method", nargs="+", metavar="NAME", help="the CPU's and, on hardware, OpenGL's if left out")
    options = options_parser.parse_args(arguments)
    about = machine.describe()
    print(about["warning"], flush=True)
    plan = Plan(options.repeats, options.budget)
    own = [scene for scene in options.scenes if scene not in kanamori_2008.SCENE_NAMES]
    rows = []
    with Renderers("bench") as renderers:
        described = renderers.describe()
        about["gl_renderer"] = described["gl_renderer"]
        methods = options.method or default_methods(described)
        for scene in own:
            chosen = variants(scene, methods, described["simd_paths"])
            for size in options.sizes:
                print(f"{scene} {size[0]}x{size[1]}", flush=True)
                rows += measure(renderers, Picture(scene, *size), chosen, plan, options.limit)
    trees = fitted_bvh.measure(own, plan, options.limit, report.OUT / "bench.log")
    if own:
        data = {"machine": about, "options": vars(options), "rows": list(map(asdict, rows)), "trees": list(map(asdict, trees))}
        parts = [report.machine_text(about), table_of(rows)] + ([fitted_bvh.table_of(trees)] if trees else [])
        report.publish("bench", data, "\n\n".join(parts), options.update_docs)
    if len(own) < len(options.scenes):
        kanamori_2008.run(options.scenes, about, options.repeats, options.limit, options.update_docs)


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
