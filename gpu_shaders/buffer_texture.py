"""A buffer that shaders read by index, like a texture of one line; moderngl has none."""

from __future__ import annotations

import ctypes
import weakref
from typing import Literal

import moderngl
import numpy as np
import numpy.typing as npt

from ..addon.fluid.errors import DeviceError
from .context import GpuContext

_GL_TEXTURE0 = 0x84C0
_GL_TEXTURE_BUFFER = 0x8C2A

Texels = Literal["i1", "u1", "u2", "u4", "f1", "f4"]
"""Which numbers of 32 bits a texel has, integers, unsigned ones or floats, and how many."""

Numbers = npt.NDArray[np.float32] | npt.NDArray[np.int32] | npt.NDArray[np.uint32]
"""Of 32 bits."""

_FORMATS: dict[Texels, int] = {"i1": 0x8235, "u1": 0x8236, "u2": 0x823C, "u4": 0x8D70, "f1": 0x822E, "f4": 0x8814}


class BufferTexture:
    """Texels of one to four numbers; pairs of 32-bit unsigned integers unless said otherwise.

    Attributes
    ----------
    buffer
        Where they lie.
    """

    def __init__(self, context: GpuContext, capacity: int, texels: Texels = "u2") -> None:
        unsigned = ctypes.c_uint
        self._context = context
        self._texel_bytes = 4 * int(texels[1])
        self._activate, self._bind = (
            context.function("glActiveTexture", unsigned),
            context.function("glBindTexture", unsigned, unsigned),
        )
        self.buffer: moderngl.Buffer = context.gl.buffer(reserve=self._texel_bytes * capacity, dynamic=True)
        name = unsigned()
        context.function("glGenTextures", ctypes.c_int, ctypes.c_void_p)(1, ctypes.byref(name))
        self._name = name.value
        weakref.finalize(self, context.delete_texture, self._name)
        self.use(0)
        context.function("glTexBuffer", unsigned, unsigned, unsigned)(_GL_TEXTURE_BUFFER, _FORMATS[texels], self.buffer.glo)

    @classmethod
    def of(cls, context: GpuContext, texels: Texels, array: Numbers) -> BufferTexture:
        """The numbers of an array; DeviceError where they are more than a shader can read."""
        count = array.size // int(texels[1])
        limit = context.limits.texture_buffer_size
        if count > limit:
            raise DeviceError(
                f"{count} texels are needed at once but {context.renderer} takes at most {limit}; "
                "show fewer balls, or choose another method"
            )
        texture = cls(context, max(count, 1), texels)
        if array.size:
            texture.buffer.write(np.ascontiguousarray(array))
        return texture

    @property
    def capacity(self) -> int:
        """How many texels it holds."""
        return int(self.buffer.size) // self._texel_bytes

    def reserve(self, count: int) -> None:
        """Make room for `count` texels; what was in the buffer is lost where there was not enough.

        DeviceError where it is more than a shader can read.
        """
        limit = self._context.limits.texture_buffer_size
        if count > limit:
            raise DeviceError(
                f"{count} parts of balls are in the view but {self._context.renderer} takes at most {limit}; "
                "choose another method"
            )
        if count > self.capacity:
            self.buffer.orphan(self._texel_bytes * count)

    def use(self, unit: int) -> None:
        """Bind it to a texture unit."""
        self._activate(_GL_TEXTURE0 + unit)
        self._bind(_GL_TEXTURE_BUFFER, self._name)
