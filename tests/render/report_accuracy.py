"""Prints the table of docs/accuracy.md: .venv/bin/python tests/render/report_accuracy.py"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from judge import Verdict, compare
from scenes import SCENES

import meniscus
from meniscus.addon.render.registry import method_infos

# The scenes of the benchmarks.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from paper_scenes import NAMES, compare_picture


def main() -> None:
    print("| method | scene | view | pixels hit | undecidable | worst dt / R | RMS dt / R | RMS dt / t | worst angle |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for info in method_infos("metaballs"):
        for name, view, verdict in verdicts(info.name):
            assert not verdict.wrong, f"{info.name}, {name}, {view}: {verdict.wrong[:3]}"
            print(
                f"| {info.name} | {name} | {view} | {verdict.compared} | {verdict.undecidable} | {verdict.worst:.1e} "
                f"| {verdict.rms:.1e} | {verdict.relative_rms:.1e} | {verdict.worst_angle:.4f} |",
                flush=True,
            )


def verdicts(method: str) -> Iterator[tuple[str, str, Verdict]]:
    """The scene, the projection and what there is to say of the picture."""
    for name, make in SCENES.items():
        for projection in ("perspective", "orthographic"):
            scene = make()
            camera = scene.camera(projection)
            yield name, projection, compare(meniscus.render(scene.balls, camera, scene.field, method=method), scene, camera)
    for name in NAMES:
        yield name, "perspective", compare_picture(method, name)


if __name__ == "__main__":
    main()
