"""What passes and files cost beside the surface: ``make bench-export``.

Renders a dense block of 120,000 balls at 1920x1080 with all passes, with and without writing files, in one process; and many
small frames, to see that memory stays flat.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np

from meniscus.samples import block, scene_parts
from meniscus.samples.one_thread import bpy

PASSES = ("combined", "depth", "normal", "position", "vector", "facing", "object_index", "color", "speed", "ball_id")


class NoWriter:
    """Takes images and writes nothing."""

    def write(self, _path: Path, _content: Any) -> Future[float]:
        done: Future[float] = Future()
        done.set_result(0.0)
        return done

    def __enter__(self) -> NoWriter:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Time passes and files.")
    parser.add_argument("--frames", type=int, default=24, help="of each sequence, 24 if left out")
    parser.add_argument("--small-frames", type=int, default=500, help="to watch the memory over, 500 if left out")
    options = parser.parse_args(arguments)
    scene = scene_parts.new_scene()
    item = block.build(scene, count=120_000)
    for frame in (1, options.frames):
        item.location.x = frame * 0.002
        item.keyframe_insert("location", frame=frame)
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    with tempfile.TemporaryDirectory() as folder:
        _report_passes(scene, folder)
        _report_writing(scene, folder, options.frames)
        _report_memory(scene, folder, options.small_frames)
    return 0


def _job(scene: bpy.types.Scene, folder: str, frames: int, passes: tuple[str, ...] = PASSES, **changes: Any) -> Any:
    from meniscus.addon.blender.render_frames import RenderJob
    from meniscus.addon.blender.render_scene import RenderSettings

    resolution, samples = changes.pop("resolution", None), changes.pop("samples", 1)
    settings = RenderSettings(passes=passes, resolution=resolution, samples=samples)
    return RenderJob(
        scene_uid=scene.session_uid,
        view_layer_name=scene.view_layers[0].name,
        settings=settings,
        frames=tuple(range(1, frames + 1)),
        output=f"{folder}/f_####.exr",
        passes=passes,
        **changes,
    )


def _seconds(job: Any, writes: bool = True) -> list[Any]:
    from meniscus.addon.blender import render_frames

    writer = render_frames.ExrProcess
    start = time.perf_counter()
    try:
        if not writes:
            render_frames.ExrProcess = NoWriter
        reports = list(render_frames.render_frames(job, lambda: False))
    finally:
        render_frames.ExrProcess = writer
    assert not any(report.error for report in reports), reports[0].error
    return [time.perf_counter() - start, reports]


def _report_passes(scene: bpy.types.Scene, folder: str) -> None:
    # Compressing would take the cores from what is timed.
    _, reports = _seconds(_job(scene, folder, 8), writes=False)
    stages = {
        name: statistics.median(report.info.milliseconds[name] for report in reports[1:])
        for name in ("build", "cast", "passes")
    }
    print(f"1920x1080, {len(PASSES)} passes: " + ", ".join(f"{name} {time:.1f} ms" for name, time in stages.items()))


def _report_writing(scene: bpy.types.Scene, folder: str, frames: int) -> None:
    for samples in (1, 16):
        rates = {}
        for compression in ("ZIP", "ZIPS", "RLE", "NONE"):
            with_files, _ = _seconds(_job(scene, folder, frames, samples=samples, compression=compression))
            rates[compression] = frames / with_files
        without, _ = _seconds(_job(scene, folder, frames, samples=samples), writes=False)
        shares = ", ".join(f"{name} {rate:.2f} ({rate * without / frames:.2f})" for name, rate in rates.items())
        print(f"{samples} samples: without files {frames / without:.2f} frames a second; with files {shares}")


def _report_memory(scene: bpy.types.Scene, folder: str, frames: int) -> None:
    from meniscus.addon.blender.render_frames import render_frames

    sizes = []
    for report in render_frames(_job(scene, folder, frames, resolution=(96, 54)), lambda: False):
        assert not report.error
        sizes.append(_resident_bytes())
    tail = np.array(sizes[len(sizes) // 5 :]) / 2**20
    print(f"{frames} frames: {tail[0]:.1f} MB after the first fifth, {tail[-1]:.1f} MB in the end")


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096


if __name__ == "__main__":
    sys.exit(main())
