"""What a viewport shows at each redraw, taken when it is drawn: the screen is always a little late."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from expected import FloatArray


@dataclass(frozen=True)
class Drawn:
    """A redraw of a viewport: the frame with its subframe, what was looked through, and the colours (height, width, 4)."""

    frame: float
    clip_from_world: FloatArray
    colors: np.ndarray


class Recorder:
    """Keeps what was drawn, up to now, in all 3D viewports; oldest first."""

    def __init__(self) -> None:
        self.drawn: list[Drawn] = []
        self.problems: list[Exception] = []

    def take(self) -> None:
        """The draw handler."""
        try:
            self.drawn.append(self._drawn())
        except Exception as problem:  # noqa: BLE001 - Blender would only print it
            self.problems.append(problem)

    def _drawn(self) -> Drawn:
        scene = bpy.context.scene
        x, y, width, height = gpu.state.viewport_get()
        buffer = gpu.state.active_framebuffer_get().read_color(x, y, width, height, 4, 0, "FLOAT")
        buffer.dimensions = width * height * 4  # in Blender 4.3 those of several dimensions have wrong strides
        colors = np.frombuffer(buffer, np.float32).reshape(height, width, 4).copy()
        clip_from_view, view_from_world = gpu.matrix.get_projection_matrix(), gpu.matrix.get_model_view_matrix()
        matrix = np.array(clip_from_view, np.float64) @ np.array(view_from_world, np.float64)
        return Drawn(scene.frame_current + scene.frame_subframe, matrix, colors)


@contextmanager
def recording() -> Iterator[Recorder]:
    """Record all redraws within, after the handlers that there are."""
    recorder = Recorder()
    handler = bpy.types.SpaceView3D.draw_handler_add(recorder.take, (), "WINDOW", "POST_VIEW")
    try:
        yield recorder
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    assert recorder.problems == []
