"""Buffers that compute shaders read and write."""

from __future__ import annotations

import ctypes

import moderngl
import numpy as np
import numpy.typing as npt

from ..addon.fluid.errors import DeviceError
from .context import GpuContext

_GL_COPY_WRITE_BUFFER = 0x8F37
_GL_R32UI = 0x8236
_GL_RED_INTEGER = 0x8D94
_GL_UNSIGNED_INT = 0x1405
_LEAST_BYTES = 64


class Storage:
    """Makes and clears buffers of a context."""

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        unsigned = ctypes.c_uint
        self._bind = context.function("glBindBuffer", unsigned, unsigned)
        self._clear = context.function("glClearBufferData", *[unsigned] * 4, ctypes.c_void_p)

    def most(self, size: int) -> int:
        """How many things of so many bytes a buffer takes."""
        return self._context.limits.storage_block_bytes // size

    def reserve(self, size: int) -> moderngl.Buffer:
        """A buffer of so many bytes; DeviceError where it is more than a shader can use."""
        limit = self._context.limits.storage_block_bytes
        if size > limit:
            raise DeviceError(
                f"{size >> 20} MB are needed at once but {self._context.renderer} takes at most {limit >> 20} MB; "
                "show fewer balls, or choose another method"
            )
        return self._context.gl.buffer(reserve=max(size, _LEAST_BYTES))

    def of(self, array: npt.NDArray[np.float32] | npt.NDArray[np.int32] | npt.NDArray[np.uint32]) -> moderngl.Buffer:
        """A buffer with the numbers of an array."""
        buffer = self.reserve(array.nbytes)
        if array.nbytes:
            buffer.write(array)
        return buffer

    def copy(self, source: moderngl.Buffer, target: moderngl.Buffer) -> None:
        """Copy a buffer to one of the same size, on the graphics processor."""
        self._context.gl.copy_buffer(target, source)

    def fill(self, buffer: moderngl.Buffer, value: int) -> None:
        """Set each unsigned integer of a buffer to a value, on the graphics processor."""
        self._bind(_GL_COPY_WRITE_BUFFER, buffer.glo)
        number = ctypes.c_uint(value)
        self._clear(_GL_COPY_WRITE_BUFFER, _GL_R32UI, _GL_RED_INTEGER, _GL_UNSIGNED_INT, ctypes.byref(number))
        self._bind(_GL_COPY_WRITE_BUFFER, 0)
