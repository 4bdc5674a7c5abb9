"""A surface that stays on the graphics processor, and the way from there into the textures of another context."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from typing import TypeVar

import moderngl
import numpy as np
import numpy.typing as npt

from ..addon.fluid.camera import Region
from ..addon.fluid.errors import DeviceError
from ..addon.fluid.passes import DEPTH_BACKGROUND
from ..addon.render.method import Attribute, Surface
from .context import GpuContext

Number = TypeVar("Number", int, float)

_FORMATS: dict[str, tuple[int, str]] = {
    "depth": (1, "f4"),
    "normal": (4, "f4"),
    "color": (4, "f4"),
    "velocity": (4, "f4"),
    "ball": (1, "i4"),
}
"""Channels and their type."""

_BACKGROUNDS = {"depth": DEPTH_BACKGROUND, "ball": -1}
"""Where there is nothing; 0 for vectors."""

_GL_TEXTURE_2D = 0x0DE1
_GL_DRAW_FRAMEBUFFER = 0x8CA9
_GL_COLOR_ATTACHMENT0 = 0x8CE0
_GL_ATTACHMENT_NAME = 0x8CD1


class SurfaceTextures:
    """What a method finds, as textures of 32-bit floats; row 0 at the bottom.

    Made, drawn and read on the context's thread, except for :meth:`read_back`. Copied where the context is current with which
    that one shares its objects. Released on any thread.

    Attributes
    ----------
    size
        Width and height, pixels.
    textures
        "depth" has one channel, vectors have four, of which the last says nothing, "ball" has whole numbers: see
        :class:`method.Surface`. Empty after the release.
    milliseconds, counts, notes
        As in :class:`method.Surface`.
    """

    def __init__(self, context: GpuContext, size: tuple[int, int], attributes: Iterable[Attribute] = ()) -> None:
        gl = context.gl
        self.size = size
        formats = {name: _FORMATS[name] for name in ("depth", "normal", *attributes)}
        self.textures: dict[str, moderngl.Texture] = {
            name: gl.texture(size, components, dtype=dtype) for name, (components, dtype) in formats.items()
        }
        self._framebuffer: moderngl.Framebuffer | None = None
        self.milliseconds: dict[str, float] = {}
        self.counts: dict[str, int] = {}
        self.notes: tuple[str, ...] = ()
        self._context = context
        self._get_attachment = context.function("glGetFramebufferAttachmentParameteriv", *[ctypes.c_uint] * 3, ctypes.c_void_p)
        self._get_error = context.function("glGetError", result=ctypes.c_uint)

    @property
    def passes(self) -> tuple[str, ...]:
        """See :meth:`method.DeviceSurface.passes`."""
        return tuple(self.textures)

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """Draws into the textures, in their order."""
        if self._framebuffer is None:
            self._framebuffer = self._context.gl.framebuffer(list(self.textures.values()))
        return self._framebuffer

    def add_report(self, milliseconds: dict[str, float], counts: dict[str, int]) -> None:
        """Add times and counts to those that are there."""
        _add(self.milliseconds, milliseconds)
        _add(self.counts, counts)

    def clear(self) -> None:
        """Make it the surface of nothing, of which nothing is reported."""
        width, height = self.size
        self.milliseconds, self.counts = {}, {}
        for name, texture in self.textures.items():
            nothing = _BACKGROUNDS.get(name, 0)
            texture.write(np.full((height, width, texture.components), nothing, texture.dtype))

    def read(self, name: str) -> npt.NDArray[np.float32]:
        """(height, width) depth or balls, else (height, width, 3)."""
        width, height = self.size
        texture = self.textures[name]
        pixels = np.frombuffer(texture.read(), texture.dtype).reshape(height, width, texture.components)
        return pixels[..., 0] if texture.components == 1 else pixels[..., :3]

    def read_into(self, surface: Surface, region: Region) -> None:
        """Fill a region of a surface, and add the times and counts to its own."""
        rows, columns = slice(region.y_min, region.y_max), slice(region.x_min, region.x_max)
        for name in self.passes:
            getattr(surface, name)[rows, columns] = self.read(name)
        _add(surface.milliseconds, self.milliseconds)
        _add(surface.counts, self.counts)

    def read_back(self) -> dict[str, npt.NDArray[np.float32]]:
        """See :meth:`method.DeviceSurface.read_back`."""
        return self._context.run(lambda: {name: self.read(name) for name in self.textures})

    def copy_to_attachments(self) -> None:
        """Copy the textures, in their order, to those of the framebuffer that is bound in the context current on this thread.

        These must have the same size and formats. Nothing leaves the graphics processor, and no state of the context changes.
        DeviceError where the driver refuses.
        """
        # Functions of OpenGL 4.3, which the context itself need not have.
        copy = self._context.function("glCopyImageSubData", *[ctypes.c_uint] * 2, *[ctypes.c_int] * 4, *_COPY_TARGET)
        # Errors from before are not ours.
        self._errors()
        for number, texture in enumerate(self.textures.values()):
            target = ctypes.c_int()
            attachment = _GL_COLOR_ATTACHMENT0 + number
            self._get_attachment(_GL_DRAW_FRAMEBUFFER, attachment, _GL_ATTACHMENT_NAME, ctypes.byref(target))
            copy(texture.glo, _GL_TEXTURE_2D, 0, 0, 0, 0, target.value, _GL_TEXTURE_2D, 0, 0, 0, 0, *self.size, 1)
        if self._errors():
            raise DeviceError("The graphics driver does not copy textures from one context to another")

    def _errors(self) -> bool:
        """Whether the driver has noted errors; it forgets them."""
        # A context that is lost may repeat its error for ever.
        return sum(bool(self._get_error()) for _ in range(8)) > 0

    def release(self) -> None:
        """Give the textures back; what was copied stays."""
        self.textures, self._framebuffer = {}, None
        self._context.collect()


_COPY_TARGET = (*[ctypes.c_uint] * 2, *[ctypes.c_int] * 7)


def _add(numbers: dict[str, Number], more: dict[str, Number]) -> None:
    """Add numbers to those of the same names."""
    for name, number in more.items():
        numbers[name] = numbers.get(name, type(number)()) + number
