"""`make bench-peers`: what users have today, timed beside Meniscus on the same balls and judged by the same oracle."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import environments
import numpy as np

import meniscus

from . import machine, report
from .judge import Judge, Judgement
from .options import parser
from .peers import cases
from .peers.peer import Case
from .renderers import Picture, Renderers
from .scenes import FIELD_OF_VIEW, SCENES, SIZES, three_quarter_camera
from .timing import CaseError, Plan, Sample, Statistics, interleave, statistics_by_stage
from .variants import Variant, default_methods
from .worker import Worker

NAME = "bench-peers"
DEFAULT_SCENES = ("block_10k", "block_120k", "block_1m", "dense_120k", "dense_1m")
JUDGED_SIZE = SIZES[0]
"""Of the picture whose rays are compared, and of Cycles' picture."""
SURFACE = "surface"
"""The stage of a peer that is compared."""
WHOLE = "render"
"""The stage of Meniscus that is compared."""


@dataclass
class Row:
    """One case on one scene.

    Attributes
    ----------
    stages
        The peer's, milliseconds.
    meniscus
        The whole call at each size, in turn with the peer, milliseconds.
    triangles
        Of the peer's mesh; None where it makes a picture.
    problem
        Why the case failed, empty where it did not.
    """

    scene: str
    balls: int
    case: Case
    stages: dict[str, Statistics] = field(default_factory=dict)
    meniscus: dict[str, Statistics] = field(default_factory=dict)
    triangles: int | None = None
    judgement: Judgement = field(default_factory=Judgement)
    problem: str = ""


@dataclass(frozen=True)
class Own:
    """Meniscus itself on one scene with one field."""

    scene: str
    field: meniscus.Field
    judgement: Judgement
    problem: str


class Bench:
    """What all cases share: the plan, the processes and a folder for files."""

    def __init__(self, options: Any, renderers: Renderers, variant: Variant, python: str, folder: Path) -> None:
        self.plan = Plan(options.repeats, options.budget)
        self.limit: float = options.limit
        self.sizes: Sequence[tuple[int, int]] = options.sizes
        self.renderers, self.variant, self.python, self.folder = renderers, variant, python, folder
        self.log = report.OUT / f"{NAME}.log"

    def peer_process(self, *module: str) -> Worker:
        """A process in the peers' environment."""
        return Worker([self.python, "-m", *module], self.log)

    def render(self, picture: Picture, save: Path | None = None) -> Sample:
        """Render with Meniscus once."""
        milliseconds: Sample = self.renderers.render(self.variant, picture, self.limit, save)["milliseconds"]
        return milliseconds


def main(arguments: list[str] | None = None) -> None:
    text = "Time what users have today beside Meniscus."
    options = parser(NAME, text, DEFAULT_SCENES, Plan(repeats=5, budget=60.0), 120.0).parse_args(arguments)
    python = str(environments.ensure(NAME).python)
    about = machine.describe()
    print(about["warning"], flush=True)
    rows: list[Row] = []
    own: list[Own] = []
    with Renderers(NAME) as renderers, tempfile.TemporaryDirectory(prefix="meniscus-") as folder:
        described = renderers.describe()
        about["gl_renderer"] = described["gl_renderer"]
        bench = Bench(options, renderers, Variant(default_methods(described)[0]), python, Path(folder))
        with bench.peer_process("bench.peers.ray_worker") as caster:
            for scene in options.scenes:
                rows_of_scene, own_of_scene = run_scene(bench, scene, caster)
                rows += rows_of_scene
                own += own_of_scene
    data = {"machine": about, "options": vars(options), "rows": list(map(asdict, rows)), "meniscus": list(map(asdict, own))}
    report.publish(NAME, data, text_of(about, bench, rows, own), options.update_docs)


def run_scene(bench: Bench, scene: str, caster: Worker) -> tuple[list[Row], list[Own]]:
    """All cases on a scene, and Meniscus with each field that they use."""
    balls = SCENES[scene].make_balls()
    camera = three_quarter_camera(balls, *JUDGED_SIZE)
    judge = Judge(balls, camera, SCENES[scene].droplets, caster, bench.folder)
    rows = []
    for case in cases():
        print(f"{scene}: {case.label}", flush=True)
        rows.append(run_case(bench, Row(scene, len(balls), case), balls, camera, judge))
    fields = dict.fromkeys(field_of(case) for case in cases())
    return rows, [judge_own(bench, scene, field, judge) for field in fields]


def field_of(case: Case) -> meniscus.Field:
    """What Meniscus renders beside a case."""
    return meniscus.Field(case.kernel, case.isovalue)


def run_case(bench: Bench, row: Row, balls: meniscus.Balls, camera: meniscus.Camera, judge: Judge) -> Row:
    """Time a case in turn with Meniscus, then judge its mesh."""
    with bench.peer_process("bench.peers.worker", row.case.module) as peer:
        try:
            peer.ask(prepare_request(bench.folder / "positions.npz", row.case, balls, camera), bench.limit)
            time_case(bench, row, peer)
            path = bench.folder / ("mesh.npz" if row.case.product == "mesh" else "picture.exr")
            row.triangles = peer.ask({"do": f"save its {row.case.product}", "path": str(path)}, bench.limit)["triangles"]
            judge_it = judge.mesh if row.case.product == "mesh" else judge.picture
            row.judgement = judge_it(path, row.case.aim, field_of(row.case))
        except CaseError as error:
            row.problem = str(error)
    return row


def prepare_request(path: Path, case: Case, balls: meniscus.Balls, camera: meniscus.Camera) -> dict[str, Any]:
    """Write the positions for the peer; lengths are in influence radii."""
    radius = float(balls.radii[0])
    np.savez(path, positions=balls.positions / np.float32(radius))
    world_from_view = camera.world_from_view.copy()
    world_from_view[:3, 3] /= radius
    task = {
        "kernel_radius": float(field_of(case).kernel_radii(np.ones(1), np.ones(1))[0]),
        "isovalue": case.isovalue,
        "world_from_view": world_from_view,
        "field_of_view": FIELD_OF_VIEW,
        "width": camera.width,
        "height": camera.height,
        "options": case.options,
    }
    return {"do": "prepare", "positions": str(path), "task": task}


def time_case(bench: Bench, row: Row, peer: Worker) -> None:
    """Fill in the times; CaseError where the peer fails."""
    measures: dict[str, Callable[[], Sample]] = {SURFACE: lambda: peer.ask({"do": "make the surface"}, bench.limit)}
    for width, height in bench.sizes:
        if row.case.product == "picture" and (width, height) != JUDGED_SIZE:
            continue
        picture = Picture(row.scene, width, height, field_of(row.case))
        measures[f"{width}x{height}"] = partial(bench.render, picture)
    outcomes = interleave(measures, bench.plan)
    of_peer = outcomes.pop(SURFACE)
    row.stages = statistics_by_stage(of_peer)
    row.meniscus = {size: whole for size, outcome in outcomes.items() if (whole := statistics_by_stage(outcome).get(WHOLE))}
    if of_peer.problem:
        raise CaseError(of_peer.problem)


def judge_own(bench: Bench, scene: str, field: meniscus.Field, judge: Judge) -> Own:
    """Judge Meniscus' own picture."""
    path = bench.folder / "image.npz"
    try:
        bench.render(Picture(scene, *JUDGED_SIZE, field), path)
        return Own(scene, field, judge.own_picture(path, field), "")
    except CaseError as error:
        return Own(scene, field, Judgement(), str(error))


def text_of(about: dict[str, Any], bench: Bench, rows: Sequence[Row], own: Sequence[Own]) -> str:
    """The report."""
    sizes = [f"{width}x{height}" for width, height in bench.sizes]
    remarks = [f"- {label}: {remark}." for label, remark in dict.fromkeys((row.case.label, row.case.remark) for row in rows)]
    parts = (
        report.machine_text(about),
        f"Meniscus renders with the method `{bench.variant.method}`. A run of a case may take {bench.limit:g} s.",
        table_of(rows, sizes),
        "\n".join(remarks),
        "Meniscus itself, at 640x480:",
        own_table(own),
    )
    return "\n\n".join(parts)


def table_of(rows: Sequence[Row], sizes: Sequence[str]) -> str:
    """A row for each case; ratios say how many times the peer's time is Meniscus'."""
    headers = ["scene", "balls", "tool", "seconds", "stages, ms"]
    headers += [header for size in sizes for header in (f"Meniscus {size}, s", "ratio")]
    headers += ["triangles", *JUDGEMENT_HEADERS]
    return report.table(headers, [_cells(row, sizes) for row in rows])


def _cells(row: Row, sizes: Sequence[str]) -> list[str]:
    surface = row.stages.get(SURFACE)
    others = [f"{stage} {report.milliseconds(of.median)}" for stage, of in row.stages.items() if stage != SURFACE]
    cells = [
        row.scene,
        str(row.balls),
        row.case.label,
        "; ".join(filter(None, [report.seconds(surface) if surface else "", row.problem])),
        ", ".join(others),
    ]
    for size in sizes:
        beside = row.meniscus.get(size)
        cells += [report.seconds(beside) if beside else "", report.ratio(surface, beside)]
    triangles = "" if row.triangles is None else str(row.triangles)
    return [*cells, triangles, *judgement_cells(row.judgement)]


JUDGEMENT_HEADERS = ("droplets lost", "distance RMS, R", "normals RMS, degrees", "rays elsewhere")


def judgement_cells(judgement: Judgement) -> list[str]:
    """Empty where it is not judged."""
    lost = "" if judgement.lost is None else f"{judgement.lost:.1%}"
    far = judgement.deviation
    if far is None:
        return [lost, "", "", ""]
    figures = ["" if figure is None else f"{figure:.2g}" for figure in (far.distance, far.angle)]
    return [lost, *figures, f"{far.elsewhere:.1%}"]


def own_table(own: Sequence[Own]) -> str:
    """Meniscus' own accuracy."""
    rows = [
        [row.scene, f"{row.field.kernel}, T = {row.field.isovalue:g}", *judgement_cells(row.judgement), row.problem]
        for row in own
    ]
    return report.table(["scene", "field", *JUDGEMENT_HEADERS, "problem"], rows)


if __name__ == "__main__":
    main()
