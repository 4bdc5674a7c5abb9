"""Frames of a scene, rendered to files one after the other: for the command line and the export.

A frame is read on Blender's own thread, and rendered and written on any; its files are compressed and written by a process of
their own while the next frame is rendered.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.errors import CancelledError, FullDiskError, GoneError, InputError, MeniscusError, OutputError
from ..fluid.image import ImageBuffers, RenderInfo
from ..fluid.passes import PASSES
from ..output.claims import claim, give_up, is_taken, remove_leftovers
from ..output.exr_content import DEEP_COMPRESSIONS, ExrContent, ExrOptions, deep_content, flat_content
from ..output.exr_process import ExrProcess
from ..output.file_names import frame_path, pass_pattern
from ..output.whole_file import prepare_place
from ..render.method import timed
from .preview import write_png
from .render_scene import Control, RenderSettings, SceneRender, read_view_layer


@dataclass(frozen=True)
class RenderJob:
    """What to render, how, and where to.

    Attributes
    ----------
    scene_uid, view_layer_name
        What is seen: a scene's `session_uid`, which it keeps when undo puts another copy in its place, and the name of its
        view layer, which becomes part of the channel names.
    settings
        How each frame is rendered; Combined is among its passes where there are previews.
    frames
        Frame numbers, in the order to render.
    output
        Absolute path with ``####`` for the frame number, and ``{pass}`` where passes have files of their own.
    passes
        Names of those that are written.
    layout
        One of :data:`exr_content.LAYOUTS`.
    use_deep
        Whether each frame gets a deep file beside the others.
    compression
        See :data:`exr_content.COMPRESSIONS`.
    use_overwrite
        Whether files that are there are written again; else their frames are left out.
    use_placeholders
        Whether a frame's files are claimed before it is rendered, so that several computers can share a range.
    use_preview
        Whether each frame gets a PNG picture beside its file.
    """

    scene_uid: int
    view_layer_name: str
    settings: RenderSettings
    frames: tuple[int, ...]
    output: str
    passes: tuple[str, ...]
    layout: str = "MULTILAYER"
    use_deep: bool = False
    compression: str = "ZIP"
    use_overwrite: bool = True
    use_placeholders: bool = False
    use_preview: bool = False

    def scene(self) -> bpy.types.Scene:
        """The scene as it is now, which has the view layer.

        Raises
        ------
        GoneError
            The user has removed one of them.
        """
        for scene in bpy.data.scenes:
            if scene.session_uid == self.scene_uid and self.view_layer_name in scene.view_layers:
                return scene
        raise GoneError(f"The view layer '{self.view_layer_name}' or its scene was removed: nothing more can be rendered")

    def paths(self, frame: int) -> dict[str, Path]:
        """The files of a frame by what they hold: "flat", the name of a pass, "deep", or "preview"."""
        if self.layout == "PASSES":
            patterns = {name: pass_pattern(self.output, PASSES[name].blender_name) for name in self.passes}
        else:
            patterns = {"flat": pass_pattern(self.output, None)}
        if self.use_deep:
            patterns["deep"] = pass_pattern(self.output, "deep")
        paths = {content: frame_path(pattern, frame) for content, pattern in patterns.items()}
        if self.use_preview:
            paths["preview"] = next(iter(paths.values())).with_suffix(".png")
        return paths


@dataclass
class FrameReport:
    """What became of one frame.

    Attributes
    ----------
    frame, paths
        Frame number and files.
    info
        How the image came about; its milliseconds start with the scene's evaluation and end with the writing.
    note
        Sentences about unusable balls, missing fluid or what could not be read, empty where there is nothing to say.
    error
        One sentence, empty where the files were written.
    written
        Those of the files that were not there already, or were to be overwritten.
    was_there
        Whether the files were there already, or another process has claimed them.
    is_last
        Whether the error holds for all frames to come: the disk is full, or the scene gone.
    """

    frame: int
    paths: list[Path]
    info: RenderInfo = field(default_factory=RenderInfo)
    note: str = ""
    error: str = ""
    written: list[Path] = field(default_factory=list)
    was_there: bool = False
    is_last: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        named = {"frame": self.frame, "path": str(self.paths[0]), "paths": list(map(str, self.paths)), "error": self.error}
        state = {
            "written": list(map(str, self.written)),
            "was_there": self.was_there,
            "note": self.note,
            "balls": self.info.counts.get("balls", 0),
        }
        return {**named, **state, **self.info.as_dict()}


@dataclass
class FrameWork:
    """One frame on its way to its files: call :meth:`read`, then :meth:`render`, then :meth:`finish`.

    Attributes
    ----------
    report
        What becomes of it.
    """

    job: RenderJob
    report: FrameReport
    paths: dict[str, Path]
    _read: SceneRender | None = None
    _options: ExrOptions = field(default_factory=ExrOptions)
    _picture: npt.NDArray[np.float32] | None = None
    _writing: list[Future[float]] = field(default_factory=list)
    _failure: MeniscusError | None = None

    @classmethod
    def of(cls, job: RenderJob, frame: int) -> FrameWork:
        """Nothing is done yet."""
        paths = job.paths(frame)
        return cls(job, FrameReport(frame, list(paths.values())), paths)

    def take(self) -> bool:
        """Claim the frame's files where that is asked for; False where there is nothing to do."""
        for path in self.paths.values():
            remove_leftovers(path)
        if not self.job.use_overwrite:
            self.paths = {content: path for content, path in self.paths.items() if not is_taken(path)}
        self.report.was_there = not self.paths or not self._claim()
        return not self.report.was_there

    def _claim(self) -> bool:
        """Put placeholders where there are no files; False where another process was quicker."""
        if not self.job.use_placeholders or all(claim(path) for path in self.paths.values() if not is_taken(path)):
            return True
        self._give_up()
        return False

    def _give_up(self) -> None:
        for path in self.paths.values():
            give_up(path)

    def read(self) -> None:
        """Bring the scene to the frame and read it: on Blender's own thread."""
        scene = self.job.scene()
        view_layer = scene.view_layers[self.job.view_layer_name]

        def set_frame(frame: int, subframe: float) -> None:
            scene.frame_set(frame, subframe=subframe)
            view_layer.update()

        milliseconds: dict[str, float] = {}
        with timed(milliseconds, "scene"):
            set_frame(self.report.frame, 0.0)
        self._options = self._options_in(scene)
        self._read = read_view_layer(view_layer.depsgraph, self.job.settings, set_frame)
        self._read.milliseconds.update({**milliseconds, **self._read.milliseconds})

    def render(self, writer: ExrProcess, control: Control) -> None:
        """Render the frame and begin to write it, or keep the failure: on any thread."""
        try:
            self._render(writer, control)
        except MeniscusError as error:
            self._failure = error

    def check(self) -> None:
        """Raise what rendering has failed with."""
        if self._failure is not None:
            raise self._failure

    def _render(self, writer: ExrProcess, control: Control) -> None:
        assert self._read is not None
        job = self.job
        image = self._read.image(control)
        self.report.info, self.report.note = image.info, _note(image)
        if "preview" in self.paths:
            self._picture = image["combined"]
        contents = [(name, self._flat(image, name)) for name in self.paths if name not in ("deep", "preview")]
        if "deep" in self.paths:
            deep = self._read.deep_image(control)
            image.info.milliseconds["spans"] = deep.info.milliseconds["spans"]
            contents.append(
                ("deep", deep_content(deep, replace(self._options, compression=_deep_compression(job.compression))))
            )
        self._read = None
        self._writing = [writer.write(self.paths[name], content) for name, content in contents]

    @property
    def is_finished(self) -> bool:
        """Whether :meth:`finish` need not wait."""
        return all(writing.done() for writing in self._writing)

    def finish(self) -> FrameReport:
        """Wait until the files are whole or have failed, and write the preview: on Blender's own thread."""
        try:
            times = [writing.result() for writing in self._writing]
            if times:
                self.report.info.milliseconds["write"] = sum(times)
            if self._picture is not None:
                with timed(self.report.info.milliseconds, "preview"):
                    write_png(self.paths["preview"], self._picture)
            if self._writing or self._picture is not None:
                self.report.written = list(self.paths.values())
        except OutputError as error:
            self.fail(error)
        return self.report

    def fail(self, error: MeniscusError) -> None:
        """Note what went wrong, and leave the frame to others."""
        self.report.error = str(error)
        self.report.is_last = isinstance(error, FullDiskError | GoneError)
        self._give_up()

    def _flat(self, image: ImageBuffers, name: str) -> ExrContent:
        job = self.job
        passes = job.passes if name == "flat" else (name,)
        # Mattes belong to the image of colours.
        mattes = image.cryptomatte if name in ("flat", job.passes[0]) else None
        written = replace(image, passes={key: image[key] for key in passes}, cryptomatte=mattes)
        return flat_content(written, self._options)

    def _options_in(self, scene: bpy.types.Scene) -> ExrOptions:
        return ExrOptions(
            view_layer=self.job.view_layer_name,
            compression=self.job.compression,
            frame=self.report.frame,
            frames_per_second=scene.render.fps / scene.render.fps_base,
            is_multipart=self.job.layout == "MULTIPART",
        )


def frames_of(scene: bpy.types.Scene) -> tuple[int, ...]:
    """The frames that a scene renders.

    Raises
    ------
    InputError
        There is none.
    """
    frames = tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    if not frames:
        raise InputError(f"The frame range of '{scene.name}', {scene.frame_start} to {scene.frame_end}, is empty: change it")
    return frames


def render_frames(job: RenderJob, is_cancelled: Callable[[], bool]) -> Iterator[FrameReport]:
    """Render all frames of a job; while one is written the next is rendered.

    Yields
    ------
    FrameReport of each frame that was begun, in order, when its files are whole or it has failed. Where the disk is full no
    more are begun.

    Raises
    ------
    MeniscusError
        The first frame that is rendered fails, or the render was cancelled. The files of frames that were begun are whole.
    """
    for step in frame_steps(job, is_cancelled):
        if isinstance(step, FrameReport):
            yield step
        else:
            step()


def frame_steps(job: RenderJob, is_cancelled: Callable[[], bool]) -> Generator[FrameReport | Callable[[], None], None, None]:
    """As :func:`render_frames`, but gives the rendering of each frame to the caller, who may do it on another thread.

    It is to be taken on Blender's own thread, and further only when the last function that it gave has been called. The user
    may undo meanwhile.
    """
    for path in job.paths(job.frames[0]).values():
        prepare_place(path)
    underway: deque[FrameWork] = deque()
    control = Control(is_cancelled)
    with ExrProcess() as writer:
        is_first = True
        for frame in job.frames:
            work = FrameWork.of(job, frame)
            underway.append(work)
            try:
                if is_cancelled():
                    raise CancelledError("The render was cancelled")
                if work.take():
                    work.read()
                    yield partial(work.render, writer, control)
                    work.check()
                    is_first = False
            except GeneratorExit:
                underway.pop().fail(CancelledError("The render was given up"))
                raise
            except CancelledError as error:
                underway.pop().fail(error)
                yield from (begun.finish() for begun in underway)
                raise
            except MeniscusError as error:
                work.fail(error)
                if is_first:
                    raise
            while underway and underway[0].is_finished:
                report = underway.popleft().finish()
                yield report
                if report.is_last:
                    yield from (begun.finish() for begun in underway)
                    return
        yield from (begun.finish() for begun in underway)


def _note(image: ImageBuffers) -> str:
    about_balls = image.info.dropped_text
    if image.info.counts.get("balls", 0) == 0:
        about_balls = "There is no fluid in this frame: if there should be, check the simulation's cache"
    return ". ".join(filter(None, (about_balls, *image.info.notes)))


def _deep_compression(compression: str) -> str:
    """The nearest that OpenEXR has for deep images."""
    return compression if compression in DEEP_COMPRESSIONS else "ZIPS"
