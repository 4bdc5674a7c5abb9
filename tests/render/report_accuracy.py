"""Prints the table of docs/accuracy.md: .venv/bin/python tests/render/report_accuracy.py"""

from __future__ import annotations

from judge import compare
from scenes import SCENES

import meniscus
from meniscus.addon.render.registry import method_infos


def main() -> None:
    print("| method | scene | view | pixels hit | undecidable | worst dt / R | RMS dt / R | worst angle |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for info in method_infos():
        for name, make in SCENES.items():
            for projection in ("perspective", "orthographic"):
                scene = make()
                camera = scene.camera(projection)
                verdict = compare(meniscus.render(scene.balls, camera, scene.field, method=info.name), scene, camera)
                assert not verdict.wrong, f"{info.name}, {name}, {projection}: {verdict.wrong[:3]}"
                print(
                    f"| {info.name} | {name} | {projection} | {verdict.compared} | {verdict.undecidable} "
                    f"| {verdict.worst:.1e} | {verdict.rms:.1e} | {verdict.worst_angle:.4f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
