"""Transform feedback: what a vertex or geometry shader emits, appended to a buffer by several draws.

moderngl captures one draw at a time and starts the buffer anew with each; here the draws share one list, so that groups can be
drawn on condition.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from contextlib import nullcontext

import moderngl

from .context import GpuContext
from .occlusion import OcclusionQuery

_GL_POINTS = 0
_GL_TRANSFORM_FEEDBACK_BUFFER = 0x8C8E
_GL_RASTERIZER_DISCARD = 0x8C89

Range = tuple[int, int, OcclusionQuery | None]
"""First point, number of points, and the occlusion query that the draw depends on."""


class Capture:
    """Captures points on one context."""

    def __init__(self, context: GpuContext) -> None:
        self._query = context.gl.query(primitives=True)
        function, unsigned, signed = context.function, ctypes.c_uint, ctypes.c_int
        self._enable, self._disable = function("glEnable", unsigned), function("glDisable", unsigned)
        self._bind_buffer = function("glBindBufferBase", unsigned, unsigned, unsigned)
        self._use_program = function("glUseProgram", unsigned)
        self._bind_vertex_array = function("glBindVertexArray", unsigned)
        self._begin, self._end = function("glBeginTransformFeedback", unsigned), function("glEndTransformFeedback")
        self._draw = function("glDrawArrays", unsigned, signed, signed)

    def points(self, vertex_array: moderngl.VertexArray, ranges: Iterable[Range], output: moderngl.Buffer) -> int:
        """Draw ranges of points and append what is emitted to `output`; how many were emitted, which may be more than fit."""
        self._use_program(vertex_array.program.glo)
        self._bind_vertex_array(vertex_array.glo)
        self._bind_buffer(_GL_TRANSFORM_FEEDBACK_BUFFER, 0, output.glo)
        self._enable(_GL_RASTERIZER_DISCARD)
        with self._query:
            self._begin(_GL_POINTS)
            for first, count, visible in ranges:
                with nullcontext() if visible is None else visible.required():
                    self._draw(_GL_POINTS, first, count)
            self._end()
        self._disable(_GL_RASTERIZER_DISCARD)
        self._bind_buffer(_GL_TRANSFORM_FEEDBACK_BUFFER, 0, 0)
        return int(self._query.primitives)
