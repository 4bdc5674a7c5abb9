"""Frames of a scene, rendered to files one after the other."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import bpy

from ..fluid.errors import CancelledError, MeniscusError, OutputError
from ..fluid.image import ImageBuffers, RenderInfo
from ..output.exr_content import ExrOptions, flat_content
from ..output.exr_process import ExrProcess
from ..output.frame_path import frame_path
from ..output.whole_file import prepare_place
from ..render.method import timed
from .preview import write_png
from .render_scene import RenderControl, RenderSettings, render_scene


@dataclass(frozen=True)
class RenderJob:
    """What to render, how, and where to.

    Attributes
    ----------
    scene, view_layer
        What is seen; the view layer's name becomes part of the channel names.
    settings
        How each frame is rendered; Combined is among its passes where there are previews.
    frames
        Frame numbers, in the order to render.
    output
        Absolute path with ``####`` for the frame number.
    passes
        Names of those that are written.
    compression
        See :data:`exr_content.COMPRESSIONS`.
    use_preview
        Whether each file gets a PNG picture beside it.
    """

    scene: bpy.types.Scene
    view_layer: bpy.types.ViewLayer
    settings: RenderSettings
    frames: tuple[int, ...]
    output: str
    passes: tuple[str, ...]
    compression: str
    use_preview: bool


@dataclass
class FrameReport:
    """What became of one frame.

    Attributes
    ----------
    frame, path
        Frame number and EXR file.
    info
        How the image came about; its milliseconds start with the scene's evaluation and end with the writing.
    left_out
        One sentence about unusable balls, empty where there were none.
    error
        One sentence, empty where the file (and the preview, if asked for) was written.
    """

    frame: int
    path: Path
    info: RenderInfo = field(default_factory=RenderInfo)
    left_out: str = ""
    error: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        balls = self.info.counts.get("balls", 0)
        return {"frame": self.frame, "path": str(self.path), "error": self.error, "balls": balls, **self.info.as_dict()}


@dataclass(frozen=True)
class _Underway:
    """A frame whose file is being written; None where there is nothing to write."""

    report: FrameReport
    writing: Future[float] | None

    @property
    def is_finished(self) -> bool:
        return self.writing is None or self.writing.done()

    def finished(self) -> FrameReport:
        """The report, when the file is whole or has failed."""
        if self.writing is not None:
            try:
                self.report.info.milliseconds["write"] = self.writing.result()
            except OutputError as error:
                self.report.error = str(error)
        return self.report


def render_frames(job: RenderJob, is_cancelled: Callable[[], bool] = lambda: False) -> Iterator[FrameReport]:
    """Render the frames of `job` to files; a frame's report comes when its file is whole or has failed.

    A frame that fails does not stop the others. Only an error in the scene at the first frame does: the rest would fail alike.

    Raises
    ------
    CancelledError
        The user cancelled; the files that were begun are whole.
    MeniscusError
        The first frame cannot be rendered, or nothing can be written to the output's folder.
    """
    prepare_place(frame_path(job.output, job.frames[0]))
    underway: deque[_Underway] = deque()
    with ExrProcess() as writer:
        for frame in job.frames:
            try:
                underway.append(_begin_frame(job, frame, writer, is_cancelled))
            except CancelledError:
                yield from (begun.finished() for begun in underway)
                raise
            except MeniscusError as error:
                if frame == job.frames[0]:
                    raise
                underway.append(_Underway(FrameReport(frame, frame_path(job.output, frame), error=str(error)), None))
            while underway and underway[0].is_finished:
                yield underway.popleft().finished()
        yield from (begun.finished() for begun in underway)


def _begin_frame(job: RenderJob, frame: int, writer: ExrProcess, is_cancelled: Callable[[], bool]) -> _Underway:
    """Render one frame and begin to write it."""
    if is_cancelled():
        raise CancelledError("The render was cancelled")
    report = FrameReport(frame, frame_path(job.output, frame))
    image = _rendered(job, report, is_cancelled)
    options = ExrOptions(
        view_layer=job.view_layer.name,
        compression=job.compression,
        frame=frame,
        frames_per_second=job.scene.render.fps / job.scene.render.fps_base,
    )
    written = replace(image, passes={name: image[name] for name in job.passes})
    writing = writer.write(report.path, flat_content(written, options))
    if job.use_preview:
        _write_preview(image, report)
    return _Underway(report, writing)


def _rendered(job: RenderJob, report: FrameReport, is_cancelled: Callable[[], bool]) -> ImageBuffers:
    milliseconds: dict[str, float] = {}
    control = RenderControl(lambda frame, subframe: _set_frame(job, frame, subframe), is_cancelled)
    with timed(milliseconds, "scene"):
        _set_frame(job, report.frame, 0.0)
    image = render_scene(job.view_layer.depsgraph, job.settings, control)
    image.info.milliseconds = {**milliseconds, **image.info.milliseconds}
    report.info = image.info
    report.left_out = image.info.dropped_text
    return image


def _set_frame(job: RenderJob, frame: int, subframe: float) -> None:
    job.scene.frame_set(frame, subframe=subframe)
    job.view_layer.update()


def _write_preview(image: ImageBuffers, report: FrameReport) -> None:
    with timed(report.info.milliseconds, "preview"):
        try:
            write_png(report.path.with_suffix(".png"), image["combined"])
        except OutputError as error:
            report.error = str(error)
