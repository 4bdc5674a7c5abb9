"""The OpenGL context: one for the process, on a thread of its own.

A standalone context made on Blender's main thread would alias Blender's own; on a thread of its own it disturbs nothing,
in the interface as well as with --background. All OpenGL work goes through :meth:`GpuContext.run`.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, TypeVar

import glcontext
import moderngl

from ..addon.fluid.errors import DeviceError
from .programs import ProgramSource

Result = TypeVar("Result")

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
_GL_TEXTURE_2D = 0x0DE1
_GL_DEPTH_COMPONENT = 0x1902
_GL_DEPTH_COMPONENT32F = 0x8CAC
_GL_FLOAT = 0x1406


class GpuContext:
    """A standalone OpenGL context.

    Attributes
    ----------
    gl
        The moderngl context; use it only within :meth:`run`.
    renderer, version
        What the driver calls itself, and its OpenGL version as moderngl writes it (330).

    Raises
    ------
    DeviceError
        There is no OpenGL, or none of version 3.3.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="meniscus-gl")
        self._programs: dict[ProgramSource, moderngl.Program] = {}
        self._thread.submit(self._open).result()

    def _open(self) -> None:
        try:
            self._glcontext = _standalone_glcontext()
            self.gl = moderngl.create_context(require=330, standalone=True, context=self._glcontext)
        # glcontext and moderngl raise bare Exception for whatever the driver lacks.
        except Exception as error:
            raise DeviceError(
                f"OpenGL 3.3 is not available here ({error}); use the CPU back-end or install a driver"
            ) from error
        # Python may collect an object on any thread; OpenGL frees it on its own, when asked.
        self.gl.gc_mode = "context_gc"
        self.renderer = self.gl.info["GL_RENDERER"]
        self.version = self.gl.version_code
        self._bind_texture = self.function("glBindTexture", ctypes.c_uint, ctypes.c_uint)
        self._tex_image_2d = self.function("glTexImage2D", *[ctypes.c_uint] * 8, ctypes.c_void_p)

    def function(self, name: str, *arguments: type) -> Callable[..., None]:
        """An OpenGL function that moderngl does not offer, by its argument types."""
        # On 64-bit systems, the only ones that Blender runs on, there is one calling convention.
        return ctypes.CFUNCTYPE(None, *arguments)(self._glcontext.load(name))

    def run(self, work: Callable[[], Result]) -> Result:
        """Do `work` on the context's thread and wait for it; DeviceError where the driver reports an error."""
        return self._thread.submit(self._checked, work).result()

    def _checked(self, work: Callable[[], Result]) -> Result:
        try:
            result = work()
        except moderngl.Error as error:
            raise DeviceError(f"The graphics driver failed ({error}); use the CPU back-end") from error
        finally:
            self.gl.gc()
        error_name = self.gl.error
        if error_name != "GL_NO_ERROR":
            raise DeviceError(f"The graphics driver reports {error_name}; render a smaller image or use the CPU back-end")
        return result

    @property
    def is_software(self) -> bool:
        """Whether OpenGL runs on the CPU here."""
        return any(name in self.renderer.lower() for name in _SOFTWARE)

    def require(self, version: int) -> None:
        """Raise DeviceError unless the context is of at least this OpenGL version (330)."""
        if self.version < version:
            raise DeviceError(
                f"OpenGL {version // 100}.{version // 10 % 10} is needed but {self.renderer} offers "
                f"{self.version // 100}.{self.version // 10 % 10}; choose another method"
            )

    def program(self, source: ProgramSource) -> moderngl.Program:
        """The program, compiled once; DeviceError with file and line where the driver rejects it."""
        if source not in self._programs:
            stages = source.sources()
            texts = {f"{stage}_shader": text.text for stage, text in stages.items()}
            try:
                self._programs[source] = self.gl.program(**texts, varyings=source.varyings)
            except moderngl.Error as error:
                log = str(error)
                for stage, text in stages.items():
                    if f"{stage}_shader" in log:
                        log = text.explain(log)
                raise DeviceError(f"The driver rejects the program '{source.name}': {log}") from error
        return self._programs[source]

    def depth_texture(self, size: tuple[int, int]) -> moderngl.Texture:
        """A depth texture of 32-bit floats to sample plainly; moderngl's own have 24 bits, too few to order crossings."""
        texture = self.gl.depth_texture(size)
        texture.compare_func = ""
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._bind_texture(_GL_TEXTURE_2D, texture.glo)
        self._tex_image_2d(_GL_TEXTURE_2D, 0, _GL_DEPTH_COMPONENT32F, *size, 0, _GL_DEPTH_COMPONENT, _GL_FLOAT, None)
        return texture


def _standalone_glcontext() -> Any:
    """glcontext's way to a standalone context: without a display on Linux."""
    if platform.system() == "Linux":
        # The names of the libraries as drivers install them; those without a number belong to developer packages.
        egl = glcontext.get_backend_by_name("egl")
        return egl(mode="standalone", libgl="libGL.so.1", libegl="libEGL.so.1", glversion=330)
    return glcontext.default_backend()(mode="standalone", glversion=330)


@lru_cache(maxsize=1)
def _opened() -> GpuContext | DeviceError:
    try:
        return GpuContext()
    except DeviceError as error:
        return error


def shared_context() -> GpuContext:
    """The process's context, opened at the first call; DeviceError, the same each time, where it cannot be."""
    opened = _opened()
    if isinstance(opened, DeviceError):
        raise opened
    return opened
