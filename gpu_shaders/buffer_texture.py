"""A buffer that shaders read by index, like a texture of one line; moderngl has none."""

from __future__ import annotations

import ctypes
import weakref

import moderngl

from ..addon.fluid.errors import DeviceError
from .context import GpuContext

_GL_TEXTURE0 = 0x84C0
_GL_TEXTURE_BUFFER = 0x8C2A
_GL_RG32UI = 0x823C
_TEXEL_BYTES = 8


class BufferTexture:
    """Pairs of 32-bit unsigned integers.

    Attributes
    ----------
    buffer
        Where they lie.
    """

    def __init__(self, context: GpuContext, capacity: int) -> None:
        unsigned = ctypes.c_uint
        self._context = context
        self._activate, self._bind = (
            context.function("glActiveTexture", unsigned),
            context.function("glBindTexture", unsigned, unsigned),
        )
        self.buffer: moderngl.Buffer = context.gl.buffer(reserve=_TEXEL_BYTES * capacity, dynamic=True)
        name = unsigned()
        context.function("glGenTextures", ctypes.c_int, ctypes.c_void_p)(1, ctypes.byref(name))
        self._name = name.value
        weakref.finalize(self, context.delete_texture, self._name)
        self.use(0)
        context.function("glTexBuffer", unsigned, unsigned, unsigned)(_GL_TEXTURE_BUFFER, _GL_RG32UI, self.buffer.glo)

    @property
    def capacity(self) -> int:
        """How many pairs it holds."""
        return int(self.buffer.size) // _TEXEL_BYTES

    def reserve(self, count: int) -> None:
        """Make room for `count` pairs; what was in the buffer is lost where there was not enough.

        DeviceError where it is more than a shader can read.
        """
        limit = self._context.limits.texture_buffer_size
        if count > limit:
            raise DeviceError(
                f"{count} parts of balls are in the view but {self._context.renderer} takes at most {limit}; "
                "choose another method"
            )
        if count > self.capacity:
            self.buffer.orphan(_TEXEL_BYTES * count)

    def use(self, unit: int) -> None:
        """Bind it to a texture unit."""
        self._activate(_GL_TEXTURE0 + unit)
        self._bind(_GL_TEXTURE_BUFFER, self._name)
