"""Rendering without the user interface: ``blender -b scene.blend --command meniscus render ...``."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

import bpy

from ..fluid.errors import InputError, MeniscusError
from ..output.whole_file import whole_file
from .command_line_arguments import parse_arguments
from .method_settings import read_choice
from .output_pattern import output_pattern
from .render_frames import FrameReport, RenderJob, frames_of, render_frames
from .render_scene import RenderSettings

_commands: list[Any] = []
"""What Blender gave for the registered command, to unregister it with."""


def register() -> None:
    """Make ``--command meniscus`` known to Blender."""
    _commands.append(bpy.utils.register_cli_command("meniscus", main))


def unregister() -> None:
    """Take the command away."""
    bpy.utils.unregister_cli_command(_commands.pop())


def main(arguments: list[str]) -> int:
    """Do what the command line asks for.

    Parameters
    ----------
    arguments
        What follows ``--command meniscus``.

    Returns
    -------
    The exit status: 0 if all was done, 1 if something failed, 2 if the arguments make no sense. Errors are one sentence
    each on the standard error.
    """
    try:
        options = parse_arguments(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        return _render(options)
    except MeniscusError as error:
        _complain(error)
        return 1


def _render(options: argparse.Namespace) -> int:
    job = _job(options)
    progress = sys.stderr if options.json == "-" else sys.stdout
    reports: list[FrameReport] = []
    error = ""
    try:
        with _cancelled_by_signals() as is_cancelled:
            for report in render_frames(job, is_cancelled):
                reports.append(report)
                _print_frame(report, f"{len(reports)}/{len(job.frames)}", progress)
    except MeniscusError as stop:
        error = str(stop)
        _complain(stop)
    _print_summary(job, reports, progress)
    if options.json:
        _write_json(options.json, {"frames_wanted": len(job.frames), "error": error, "frames": reports})
    return 0 if sum(1 for report in reports if not report.error) == len(job.frames) else 1


def _job(options: argparse.Namespace) -> RenderJob:
    """What to render: the options, and the scene's own settings for what they leave open."""
    scene = bpy.context.scene
    frames = options.frames or frames_of(scene)
    view_layer = _view_layer(scene, options.view_layer)
    settings = RenderSettings.of(
        scene,
        view_layer,
        passes=tuple(dict.fromkeys((*options.passes, *(("combined",) if options.preview else ())))),
        samples=options.samples,
        choice=read_choice(scene, options.method, options.backend).unhurried.with_written(options.setting),
        display=options.display,
        camera=_camera(scene, options.camera),
        resolution=options.resolution,
        tracing={
            "use_tracing": options.ray_tracing,
            "reflections": options.reflections,
            "refractions": options.refractions,
            "occlusion_rays": options.occlusion_rays,
            "samples": options.light_samples,
        },
    )
    return RenderJob(
        scene_uid=scene.session_uid,
        view_layer_name=view_layer.name,
        settings=settings,
        frames=frames,
        output=output_pattern(options.output, scene, view_layer, settings, len(frames)),
        passes=options.passes,
        layout=options.layout.upper(),
        use_deep=options.deep,
        compression=options.compression,
        use_overwrite=scene.render.use_overwrite if options.overwrite is None else options.overwrite,
        use_placeholders=scene.render.use_placeholder if options.placeholders is None else options.placeholders,
        use_preview=options.preview,
    )


def _view_layer(scene: bpy.types.Scene, name: str | None) -> bpy.types.ViewLayer:
    if name is None:
        return bpy.context.view_layer
    if name not in scene.view_layers:
        raise InputError(f"The scene has no view layer '{name}': choose from {', '.join(scene.view_layers.keys())}")
    return scene.view_layers[name]


def _camera(scene: bpy.types.Scene, name: str | None) -> bpy.types.Object | None:
    if name is None:
        return None
    if name not in scene.objects:
        raise InputError(f"The scene has no object '{name}' to use as its camera; check the name")
    return scene.objects[name]


@contextmanager
def _cancelled_by_signals() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C (or a farm's terminate) came; a second one ends Blender at once."""
    cancelled = threading.Event()

    def cancel(number: int, _: object) -> None:
        cancelled.set()
        signal.signal(number, signal.SIG_DFL)

    # Blender's own handlers are unknown to Python (None) and cannot be put back.
    before = {number: signal.signal(number, cancel) or signal.SIG_DFL for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield cancelled.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _print_frame(report: FrameReport, place: str, stream: TextIO) -> None:
    head = f"Frame {report.frame} ({place})"
    if report.error:
        print(f"{head}: {report.error}", file=sys.stderr, flush=True)
        return
    if report.was_there:
        print(f"{head}: left out, because it is there or claimed", file=stream)
    else:
        balls, spent = report.info.counts.get("balls", 0), sum(report.info.milliseconds.values())
        print(f"{head}: {balls:,} balls, {spent:,.0f} ms, {report.info.device}", file=stream)
    print(*_as_blender_says(report), sep="\n", file=stream, flush=True)
    if report.note:
        print(f"{head}: {report.note}", file=sys.stderr, flush=True)


def _as_blender_says(report: FrameReport) -> list[str]:
    """The lines that Blender prints for a frame: farm managers take files and progress from them."""
    if report.was_there:
        return [f'skipping existing frame "{report.paths[0]}"']
    minutes, seconds = divmod(sum(report.info.milliseconds.values()) / 1e3, 60)
    return [*(f"Saved: '{path}'" for path in report.written), f"Time: {minutes:02.0f}:{seconds:05.2f}"]


def _print_summary(job: RenderJob, reports: list[FrameReport], stream: TextIO) -> None:
    written = _count_written(reports)
    failed = sum(1 for report in reports if report.error)
    parts = [f"Meniscus wrote {written} of {len(job.frames)} frames"]
    there = sum(1 for report in reports if report.was_there)
    if there:
        parts.append(f"{there} were there or claimed")
    if failed:
        parts.append(f"{failed} failed")
    if len(reports) < len(job.frames):
        parts.append(f"{len(job.frames) - len(reports)} were not rendered")
    dropped: Counter[str] = Counter()
    for report in reports:
        dropped.update(report.info.dropped)
    parts += [f"{count} balls were left out because their {reason}" for reason, count in dropped.items()]
    print("; ".join(parts), file=stream, flush=True)


def _count_written(reports: list[FrameReport]) -> int:
    return sum(1 for report in reports if not report.error and not report.was_there)


def _write_json(target: str, summary: dict[str, Any]) -> None:
    text = json.dumps(summary, default=FrameReport.as_dict)
    if target == "-":
        print(text, flush=True)
        return
    with whole_file(target) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def _complain(error: MeniscusError) -> None:
    print(f"meniscus: {error}", file=sys.stderr, flush=True)
