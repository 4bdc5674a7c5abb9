"""The OpenGL context: one for the process, on a thread of its own.

A standalone context made on Blender's main thread would alias Blender's own; on a thread of its own it disturbs nothing,
in the interface as well as with --background. All OpenGL work goes through :meth:`GpuContext.run`. Where Blender runs on OpenGL
as well, the process's context may share its objects with Blender's: :func:`share_with_current_context`.
"""

from __future__ import annotations

import ctypes
import platform
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import partial
from threading import Lock
from typing import Any, TypeVar, cast

import glcontext
import moderngl

from ..addon.fluid.errors import DeviceError
from .debug_output import DebugOutput
from .driver_state import CONTEXT_LOST, DriverState
from .limits import Limits
from .programs import ProgramSource
from .sharing import VERSIONS, SharingContext, sharing_context

Result = TypeVar("Result")
Kept = TypeVar("Kept")

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
_GL_TEXTURE_2D = 0x0DE1
_GL_DEPTH_COMPONENT = 0x1902
_GL_DEPTH_COMPONENT32F = 0x8CAC
_GL_FLOAT = 0x1406
_LOST = (
    "The graphics driver was reset and what was being rendered is lost; render again, and if it happens again a smaller image "
    "or on the CPU back-end"
)


class GpuContext:
    """An OpenGL context on a thread of its own.

    Parameters
    ----------
    sharing
        A context of the window system to use; None for a standalone one.

    Attributes
    ----------
    gl
        The moderngl context; use it only within :meth:`run`.
    renderer, version
        What the driver calls itself, and its OpenGL version as moderngl writes it (330).
    limits
        How much it can take at once.
    shares
        Whether it shares its objects with another context of the process.
    is_lost
        Whether the driver was seen to have lost the context, or it was closed; nothing can be done in it any more.

    Raises
    ------
    DeviceError
        There is no OpenGL, or none of version 3.3.
    """

    def __init__(self, sharing: SharingContext | None = None) -> None:
        self.shares = sharing is not None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="meniscus-gl")
        self._programs: dict[ProgramSource, moderngl.Program | moderngl.ComputeShader] = {}
        self._kept: dict[Callable[[GpuContext], Any], Any] = {}
        self._deleted_textures: deque[int] = deque()
        # As many as tell what is wrong, where nobody takes them.
        self._messages: deque[str] = deque(maxlen=64)
        self.is_lost = False
        self._thread.submit(self._open, sharing).result()

    def _open(self, sharing: SharingContext | None) -> None:
        try:
            own: Any = _standalone_glcontext() if sharing is None else sharing
            self._glcontext = own
            if sharing is not None:
                sharing.__enter__()
            self.gl = moderngl.create_context(require=330, standalone=True, context=self._glcontext)
        # glcontext and moderngl raise bare Exception for whatever the driver lacks.
        except Exception as error:
            if sharing is not None:
                sharing.release()
            raise DeviceError(
                f"OpenGL 3.3 is not available here ({error}); use the CPU back-end or install a driver"
            ) from error
        # Python may collect an object on any thread; OpenGL frees it on its own, when asked.
        self.gl.gc_mode = "context_gc"
        self._no_framebuffer = self.gl.detect_framebuffer(0)
        self.renderer = self.gl.info["GL_RENDERER"]
        self.version = self.gl.version_code
        self.limits = Limits.from_info(self.gl.info)
        self._driver = DriverState(self.gl, self.function)
        self._debug_output = DebugOutput(self.gl, self.function)
        self._delete_textures = self.function("glDeleteTextures", ctypes.c_int, ctypes.c_void_p)
        self._use_program = self.function("glUseProgram", ctypes.c_uint)
        self._uniform_1i = self.function("glUniform1i", ctypes.c_int, ctypes.c_int)
        self._bind_texture = self.function("glBindTexture", ctypes.c_uint, ctypes.c_uint)
        self._tex_image_2d = self.function("glTexImage2D", *[ctypes.c_uint] * 8, ctypes.c_void_p)

    def function(self, name: str, *arguments: type, result: type | None = None) -> Any:
        """An OpenGL function that moderngl does not offer, by the types of its arguments and its result."""
        # On 64-bit systems, the only ones that Blender runs on, there is one calling convention.
        return ctypes.CFUNCTYPE(result, *arguments)(self._glcontext.load(name))

    def run(self, work: Callable[[], Result]) -> Result:
        """Do `work` on the context's thread and wait for it; DeviceError where the driver reports an error or was reset."""
        return self._thread.submit(self._checked, work).result()

    def _checked(self, work: Callable[[], Result]) -> Result:
        if self.is_lost:
            raise DeviceError(_LOST)
        try:
            result = work()
        except Exception as error:
            self._check_driver(error)
            raise
        finally:
            self._collect()
        self._check_driver(None)
        return result

    def kept(self, kind: Callable[[GpuContext], Kept]) -> Kept:
        """What `kind` makes of the context: made at the first call, kept until the context is closed."""
        if kind not in self._kept:
            self._kept[kind] = kind(self)
        return cast(Kept, self._kept[kind])

    def delete_texture(self, name: int) -> None:
        """Have a texture deleted that moderngl does not know; on any thread."""
        self._deleted_textures.append(name)

    def collect(self) -> None:
        """Have the memory of objects freed that nobody holds any more, without waiting for it."""
        self._thread.submit(lambda: None if self.is_lost else self._collect())

    def _collect(self) -> None:
        # moderngl holds the framebuffer that was used last, and with it what is attached there.
        self._no_framebuffer.use()
        self.gl.gc()
        while self._deleted_textures:
            self._delete_textures(1, ctypes.byref(ctypes.c_uint(self._deleted_textures.popleft())))

    def _check_driver(self, failure: Exception | None) -> None:
        """Raise DeviceError where the driver was reset, else for the driver's own part in a failure, else for its errors."""
        errors, messages = self._driver.errors(), self._debug_output.messages()
        self._messages += messages
        if CONTEXT_LOST in errors:
            self.is_lost = True
            raise DeviceError(_LOST) from failure
        if isinstance(failure, moderngl.Error):
            raise DeviceError(f"The graphics driver failed ({failure}); use the CPU back-end") from failure
        if errors and failure is None:
            details = f" ({messages[-1]})" if messages else ""
            raise DeviceError(
                f"The graphics driver reports {', '.join(errors)}{details}; render a smaller image or use the CPU back-end"
            )

    def debug_messages(self) -> list[str]:
        """The driver's messages on wrong use of OpenGL since the last call, see :class:`debug_output.DebugOutput`."""
        messages = list(self._messages)
        self._messages.clear()
        return messages

    def close(self) -> Future[None]:
        """Give the context and its objects back to the driver, after the work that was asked for before.

        It does not wait for that: the driver may hang.
        """
        return self._thread.submit(self._close)

    def _close(self) -> None:
        self.is_lost = True
        # What it shares would outlive it.
        self._kept.clear()
        self._programs.clear()
        self._collect()
        # A context is destroyed once it is current nowhere.
        with self._glcontext:
            self._glcontext.release()

    @property
    def is_software(self) -> bool:
        """Whether OpenGL runs on the CPU here."""
        return any(name in self.renderer.lower() for name in _SOFTWARE)

    def require(self, version: int, draw_buffers: int = 0, texture_size: int = 0, storage_blocks: int = 0) -> None:
        """Raise DeviceError unless the context has at least this OpenGL version (330), so many render targets at once, texels
        along a texture's side, and storage blocks of a compute shader.
        """
        if self.version < version:
            raise DeviceError(
                f"OpenGL {version // 100}.{version // 10 % 10} is needed but {self.renderer} offers "
                f"{self.version // 100}.{self.version // 10 % 10}; choose another method"
            )
        if self.limits.draw_buffers < draw_buffers:
            raise DeviceError(
                f"{draw_buffers} render targets at once are needed but {self.renderer} offers {self.limits.draw_buffers}; "
                "choose another method"
            )
        if self.limits.texture_size < texture_size:
            raise DeviceError(
                f"Textures of {texture_size} texels a side are needed but {self.renderer} offers {self.limits.texture_size}; "
                "choose another method"
            )
        if self.limits.storage_blocks < storage_blocks:
            raise DeviceError(
                f"{storage_blocks} storage blocks are needed but {self.renderer} offers {self.limits.storage_blocks}; "
                "choose another method"
            )

    def program(self, source: ProgramSource) -> moderngl.Program:
        """The program, compiled once; DeviceError with files and lines where the driver rejects it."""
        return cast(moderngl.Program, self._compiled(source))

    def compute_shader(self, source: ProgramSource) -> moderngl.ComputeShader:
        """The program of a compute shader, as :meth:`program`."""
        return cast(moderngl.ComputeShader, self._compiled(source))

    def _compiled(self, source: ProgramSource) -> moderngl.Program | moderngl.ComputeShader:
        if source not in self._programs:
            try:
                self._programs[source] = self._compile(source)
            except moderngl.Error as error:
                raise DeviceError(
                    f"The graphics driver rejects {', '.join(source.files.values())}; choose another method, or install "
                    f"another driver: {source.explain(str(error))}"
                ) from error
        return self._programs[source]

    def _compile(self, source: ProgramSource) -> moderngl.Program | moderngl.ComputeShader:
        texts = {stage: text.text for stage, text in source.sources().items()}
        if source.compute is not None:
            return self.gl.compute_shader(texts["compute"])
        return self.gl.program(
            vertex_shader=texts["vertex"],
            geometry_shader=texts.get("geometry"),
            fragment_shader=texts.get("fragment"),
            varyings=source.varyings,
        )

    def set_sampler_units(self, program: moderngl.Program, units: Mapping[str, int]) -> None:
        """Say which texture unit each sampler reads; moderngl does not know samplers of buffer textures."""
        self._use_program(program.glo)
        for name, unit in units.items():
            sampler = program[name]
            assert isinstance(sampler, moderngl.Uniform)
            self._uniform_1i(sampler.location, unit)

    def depth_texture(self, size: tuple[int, int]) -> moderngl.Texture:
        """A depth texture of 32-bit floats to sample plainly; moderngl's own have 24 bits, too few to order crossings."""
        texture = self.gl.depth_texture(size)
        texture.compare_func = ""
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._bind_texture(_GL_TEXTURE_2D, texture.glo)
        self._tex_image_2d(_GL_TEXTURE_2D, 0, _GL_DEPTH_COMPONENT32F, *size, 0, _GL_DEPTH_COMPONENT, _GL_FLOAT, None)
        return texture


def _standalone_glcontext() -> Any:
    """glcontext's way to a standalone context, of the first version that there is: without a display on Linux."""
    if platform.system() == "Linux":
        # The names of the libraries as drivers install them; those without a number belong to developer packages.
        make = partial(glcontext.get_backend_by_name("egl"), libgl="libGL.so.1", libegl="libEGL.so.1")
    else:
        make = glcontext.default_backend()
    *newer, oldest = (100 * major + 10 * minor for major, minor in VERSIONS)
    for version in newer:
        # glcontext raises bare Exception for whatever the driver lacks.
        with suppress(Exception):
            return make(mode="standalone", glversion=version)
    return make(mode="standalone", glversion=oldest)


_opening = Lock()
_shared: GpuContext | DeviceError | None = None


def shared_context() -> GpuContext:
    """The process's context: opened at the first call, and anew when it was lost.

    DeviceError where it cannot be opened: at the first call, then the same each time; or now, after it was lost.
    """
    global _shared
    with _opening:
        if _shared is None:
            try:
                _shared = GpuContext()
            except DeviceError as error:
                _shared = error
        if isinstance(_shared, DeviceError):
            raise _shared
        if _shared.is_lost:
            lost, _shared = _shared, GpuContext()
            lost.close()
        return _shared


def share_with_current_context() -> None:
    """From now on the process's context shares its objects with the one that is current on this thread; that stays current.

    Nothing happens where it shares already. The program must call :func:`close_context` before it closes its own context.
    DeviceError where it cannot be; then the process's context stays what it is.
    """
    global _shared
    with _opening:
        if isinstance(_shared, GpuContext) and _shared.shares and not _shared.is_lost:
            return
        sharing = GpuContext(sharing_context())
        before, _shared = _shared, sharing
    if isinstance(before, GpuContext):
        before.close()


def stop_sharing() -> None:
    """Leave nothing to other contexts any more. The context itself stays, as what it has made is still in use."""
    shared_context().shares = False


def close_context(seconds: float = 5.0) -> None:
    """Close the process's context, and wait for it so long; another one is opened when it is asked for."""
    global _shared
    with _opening:
        before, _shared = _shared, None
    if isinstance(before, GpuContext):
        wait([before.close()], seconds)
