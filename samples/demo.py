"""The demo: frames of the dam break, rendered headless as a user would, with pictures and a summary.

``python -m meniscus.samples.demo`` bakes the simulation (once), renders through the same command line as Blender's
``--command meniscus render`` and writes EXR files, PNG previews, a contact sheet and summary.json to out/demo.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from ..addon.fluid.errors import MeniscusError
from . import dam_break, scene_parts
from .one_thread import bpy

FOLDER = Path(__file__).resolve().parents[1] / "out" / "demo"
FRAMES = "1,8,14,20,26,33,42,60"
"""From the standing block over the splashes at the pillar and the wall to the wave that comes back."""
SHEET_COLUMNS = 2

Report = dict[str, Any]


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; the exit status is 0 only if every file was written."""
    options = _options(arguments)
    folder = Path(options.output).absolute()
    try:
        bake_seconds = _open_simulation()
        report_file = folder / "summary.json"
        status = _render(folder, options.frames, options.resolution, report_file)
        if status != 0:
            return status
        reports = json.loads(report_file.read_text(encoding="utf-8"))["frames"]
        _write_contact_sheet(folder / "contact_sheet.png", reports)
        summary = _summary(reports, bake_seconds)
        report_file.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    except (MeniscusError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    _print_summary(summary, folder)
    return 0


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Bake the dam break, render frames of it and make a contact sheet.")
    parser.add_argument("--output", default=str(FOLDER), metavar="FOLDER", help="out/demo beside the code if left out")
    parser.add_argument("--frames", default=FRAMES, metavar="LIST", help=f"{FRAMES} if left out")
    parser.add_argument("--resolution", default="640x360", metavar="WxH", help="640x360 if left out")
    return parser.parse_args(arguments)


def _open_simulation() -> float:
    """Open the baked dam break; returns the seconds that baking (or finding it baked before) took."""
    print("Dam break: Blender simulates it the first time, which takes a minute or more", flush=True)
    scene_parts.new_scene()
    start = time.perf_counter()
    path = dam_break.baked_file()
    seconds = time.perf_counter() - start
    bpy.ops.wm.open_mainfile(filepath=str(path))
    print(f"Dam break: opened {path}", flush=True)
    return seconds


def _render(folder: Path, frames: str, resolution: str, report_file: Path) -> int:
    # Imported here because it loads bpy, which one_thread has to do first.
    from ..addon.blender import command_line

    return command_line.main(
        [
            "render",
            f"--frames={frames}",
            "--output",
            str(folder / "dam_break_####.exr"),
            "--resolution",
            resolution,
            "--passes",
            "combined,depth,normal",
            "--preview",
            "--json",
            str(report_file),
        ]
    )


def _write_contact_sheet(path: Path, reports: list[Report]) -> None:
    """All previews in one picture, in rows, each with its frame number."""
    previews = [_labelled_preview(report) for report in reports]
    width, height = previews[0].size
    rows = -(-len(previews) // SHEET_COLUMNS)
    sheet = Image.new("RGB", (width * SHEET_COLUMNS, height * rows))
    for place, preview in enumerate(previews):
        sheet.paste(preview, (place % SHEET_COLUMNS * width, place // SHEET_COLUMNS * height))
    sheet.save(path)


def _labelled_preview(report: Report) -> Image.Image:
    with Image.open(Path(report["path"]).with_suffix(".png")) as picture:
        preview = picture.convert("RGB")
    label = f"frame {report['frame']}, {report['balls']:,} balls"
    ImageDraw.Draw(preview).text((8, 6), label, fill=(230, 230, 230))
    return preview


def _summary(reports: list[Report], bake_seconds: float) -> dict[str, Any]:
    return {
        "scene": "dam_break",
        "blender": bpy.app.version_string,
        "bake_seconds": round(bake_seconds, 1),
        "method": reports[0]["method"],
        "device": reports[0]["device"],
        "frames": reports,
    }


def _print_summary(summary: dict[str, Any], folder: Path) -> None:
    print(f"\nDam break in Blender {summary['blender']}, {summary['method']} on {summary['device']}")
    for report in summary["frames"]:
        stages = ", ".join(f"{stage} {spent:.0f}" for stage, spent in report["milliseconds"].items())
        print(f"frame {report['frame']:3}  {report['balls']:7,} balls  {Path(report['path']).name}  milliseconds: {stages}")
    print(f"Files: {folder}; all pictures at a glance: {folder / 'contact_sheet.png'}")


if __name__ == "__main__":
    raise SystemExit(main())
