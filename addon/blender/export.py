"""Exports the passes of a view layer to OpenEXR files while the user may watch, or go on."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..fluid.errors import CancelledError, GoneError, MeniscusError
from ..output.exr_content import COMPRESSIONS, LAYOUTS
from .output_pattern import output_pattern
from .render_frames import FrameReport, RenderJob, frame_steps, frames_of
from .render_scene import RenderSettings
from .sources import has_sources

_TICK = 0.02
"""Seconds between two looks at what the thread does and whether the user gave up."""

Result = set[str]

# Python 3.11 sees no other names in a comprehension within an annotation.
_LAYOUTS = [(name, *texts) for name, texts in LAYOUTS.items()]
_COMPRESSIONS = [(name, name.title(), text) for name, text in COMPRESSIONS.items()]


_running: list[_Run] = []
"""The export that is on its way, if there is one."""


class MENISCUS_OT_export_passes(bpy.types.Operator):
    """Render the passes that the view layer asks for to OpenEXR files; overwriting and placeholders are those of the output"""

    bl_idname = "meniscus.export_passes"
    bl_label = "Export Fluid Passes"
    bl_options: ClassVar[set[str]] = {"REGISTER"}

    filepath: StringProperty(
        name="File", description="Where to write; #### is the frame number, {pass} the name of a pass", subtype="FILE_PATH"
    )
    filter_glob: StringProperty(default="*.exr", options={"HIDDEN"})
    use_animation: BoolProperty(
        name="Animation", description="Export all frames of the scene's range, else the present one", default=True
    )
    layout: EnumProperty(
        name="Layout",
        description="How passes are put into files",
        items=_LAYOUTS,
    )
    use_deep: BoolProperty(
        name="Deep", description="Also write a deep file, which can be merged with smoke and solids inside the fluid"
    )
    compression: EnumProperty(
        name="Compression",
        description="All lossless",
        items=_COMPRESSIONS,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_sources(context.scene):
            cls.poll_message_set("The scene has no fluid: use an object as fluid first")
            return False
        if _running:
            cls.poll_message_set("Another export is running: wait for it, or cancel it by Escape")
            return False
        return True

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        if not self.filepath:
            self.filepath = f"{Path(bpy.data.filepath).stem or 'fluid'}_####.exr"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            job = self._job(context)
            self._run = _Run(job)
            if bpy.app.background:
                self._run.to_the_end()
                return self._finish(context)
        except MeniscusError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, len(job.frames))
        self._timer = manager.event_timer_add(_TICK, window=context.window)
        manager.modal_handler_add(self)
        _running.append(self._run)
        return {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Blender ends the export, because another file is opened."""
        self._run.cancel()
        self._end()

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC" and event.value == "PRESS":
            self._run.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._run.advance():
            return self._finish(context)
        context.window_manager.progress_update(len(self._run.reports))
        context.workspace.status_text_set(f"{self._run.progress_text}   Esc: cancel")
        return {"PASS_THROUGH"}

    def _finish(self, context: bpy.types.Context) -> Result:
        if not bpy.app.background:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
        self._end()
        kind, sentence = self._run.outcome
        self.report({kind}, sentence)
        return {"CANCELLED"} if kind == "ERROR" else {"FINISHED"}

    def _end(self) -> None:
        self._run.close()
        if self._run in _running:
            _running.remove(self._run)

    def _job(self, context: bpy.types.Context) -> RenderJob:
        scene, view_layer = context.scene, context.view_layer
        settings = RenderSettings.of(scene, view_layer)
        frames = frames_of(scene) if self.use_animation else (scene.frame_current,)
        return RenderJob(
            scene_uid=scene.session_uid,
            view_layer_name=view_layer.name,
            settings=settings,
            frames=frames,
            output=output_pattern(self.filepath, scene, view_layer, settings, len(frames)),
            passes=settings.passes,
            layout=self.layout,
            use_deep=self.use_deep,
            compression=self.compression,
            use_overwrite=scene.render.use_overwrite,
            use_placeholders=scene.render.use_placeholder,
        )


class _Run:
    """A job on its way: reads on this thread and renders on another."""

    def __init__(self, job: RenderJob) -> None:
        self._job, self._cancelled = job, Event()
        self._steps = frame_steps(job, self._cancelled.is_set)
        self._thread = ThreadPoolExecutor(1, "meniscus-export")
        self._rendering: Future[None] | None = None
        self._failure: MeniscusError | None = None
        self._frame = job.scene().frame_current
        self.reports: list[FrameReport] = []

    def cancel(self) -> None:
        """Give up; the files of frames that were begun become whole."""
        self._cancelled.set()

    def advance(self) -> bool:
        """Go on where that does not keep Blender waiting for long; False when all is done."""
        if self._rendering is not None:
            if not self._rendering.done():
                return True
            if failure := self._rendering.exception():
                self._failure = MeniscusError(f"Meniscus failed unexpectedly ({failure}): please report it")
                return False
        try:
            step = next(self._steps)
        except StopIteration:
            return False
        except MeniscusError as error:
            self._failure = error
            return False
        if isinstance(step, FrameReport):
            self.reports.append(step)
        else:
            self._rendering = self._thread.submit(step)
        return True

    def to_the_end(self) -> None:
        """Go on until all is done."""
        while self.advance():
            if self._rendering is not None:
                wait([self._rendering])

    def close(self) -> None:
        """End the thread, and bring the scene back to the frame that it had, where it is still there."""
        self._thread.shutdown()
        self._steps.close()
        with suppress(GoneError):
            self._job.scene().frame_set(self._frame)

    @property
    def progress_text(self) -> str:
        """How far it is."""
        return f"Meniscus exports: {len(self.reports)} of {len(self._job.frames)} frames written"

    @property
    def outcome(self) -> tuple[str, str]:
        """Kind and sentence of what to tell the user in the end."""
        there = sum(report.was_there for report in self.reports)
        errors = [report.error for report in self.reports if report.error]
        written = len(self.reports) - there - len(errors)
        sentence = f"Meniscus wrote {written} of {len(self._job.frames)} frames"
        sentence += f"; {there} were there or claimed" if there else ""
        if isinstance(self._failure, CancelledError):
            return "WARNING", f"Cancelled: {sentence}"
        if self._failure is not None or errors:
            return "ERROR", f"{self._failure or errors[0]} ({sentence})"
        notes = [report.note for report in self.reports if report.note]
        return ("WARNING", f"{sentence}; {notes[0]}") if notes else ("INFO", sentence)


def _draw_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    menu.layout.operator(MENISCUS_OT_export_passes.bl_idname, text="Fluid Passes (.exr)")


def register() -> None:
    """Offer the export."""
    bpy.utils.register_class(MENISCUS_OT_export_passes)
    bpy.types.TOPBAR_MT_file_export.append(_draw_menu)


def unregister() -> None:
    """Take the export away."""
    bpy.types.TOPBAR_MT_file_export.remove(_draw_menu)
    bpy.utils.unregister_class(MENISCUS_OT_export_passes)
