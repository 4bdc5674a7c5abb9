"""OpenGL contexts that share their objects with the one that is current on a thread, such as Blender's.

glcontext can make such contexts, but none that fits a second thread in a program with windows. On GLX it draws to the program's
window, which may be closed at any time, and does not put the program's X error handler back, so that the next error ends
the program. On EGL a window is refused to a second thread. And either leaves the new context current where the program
expects its own. Here the new context needs no window, and is current nowhere until somebody enters it.

Linux only: macOS has no Blender on OpenGL, and for Windows this is not written.
"""

from __future__ import annotations

import ctypes
import platform
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..addon.fluid.errors import DeviceError

VERSIONS = (4, 3), (3, 3)
"""Of OpenGL, as asked for in turn: some drivers give no more than that."""


_POINTER, _XID, _UNSIGNED, _SIGNED = ctypes.c_void_p, ctypes.c_ulong, ctypes.c_uint, ctypes.c_int
_ERROR_HANDLER = ctypes.CFUNCTYPE(_SIGNED, _POINTER, _POINTER)

# GLX
_GLX_FBCONFIG_ID, _GLX_SCREEN = 0x8013, 0x800C
_GLX_CONTEXT_MAJOR_VERSION, _GLX_CONTEXT_MINOR_VERSION = 0x2091, 0x2092
_GLX_CONTEXT_PROFILE_MASK, _GLX_CONTEXT_CORE_PROFILE_BIT = 0x9126, 1
_GLX_PBUFFER_WIDTH, _GLX_PBUFFER_HEIGHT = 0x8041, 0x8040

# EGL
_EGL_EXTENSIONS, _EGL_CONFIG_ID, _EGL_NONE, _EGL_OPENGL_API = 0x3055, 0x3028, 0x3038, 0x30A2
_EGL_CONTEXT_MAJOR_VERSION, _EGL_CONTEXT_MINOR_VERSION = 0x3098, 0x30FB
_EGL_CONTEXT_PROFILE_MASK, _EGL_CONTEXT_CORE_PROFILE_BIT = 0x30FD, 1


class SharingContext(ABC):
    """A context without a window that shares with the one that is current where it is made; moderngl takes it as its own.

    Attributes
    ----------
    is_offered
        Whether the window system knows of a current context on this thread; without one nothing else can be used.

    Raises
    ------
    OSError
        The window system's library is missing.
    DeviceError
        The driver gives no such context.
    """

    is_offered: bool

    @abstractmethod
    def load(self, name: str) -> int | None:
        """The address of an OpenGL function."""

    def load_opengl_function(self, name: str) -> int:
        """The same as moderngl asks for it: 0 where there is none."""
        return self.load(name) or 0

    @abstractmethod
    def __enter__(self) -> None:
        """Make it current on this thread."""

    @abstractmethod
    def __exit__(self, *_: object) -> None:
        """Make none current on this thread."""

    @abstractmethod
    def release(self) -> None:
        """Give it back to the driver; it must not be current on another thread."""


def sharing_context() -> SharingContext:
    """A context that shares with the one that is current on this thread, and that stays current.

    DeviceError where there is none, or where its driver gives no such context.
    """
    for kind in (GlxContext, EglContext) if platform.system() == "Linux" else ():
        try:
            context = kind()
        except OSError:
            continue
        if context.is_offered:
            return context
    raise DeviceError("There is no OpenGL context here with which textures can be shared")


class GlxContext(SharingContext):
    """On X11."""

    def __init__(self) -> None:
        library = ctypes.CDLL("libGL.so.1")
        self._load = _function(library, "glXGetProcAddressARB", _POINTER, ctypes.c_char_p)
        current = _function(library, "glXGetCurrentContext", _POINTER)()
        self._display = _function(library, "glXGetCurrentDisplay", _POINTER)()
        self.is_offered = bool(current and self._display)
        if not self.is_offered:
            return
        self._x11 = ctypes.CDLL("libX11.so.6")
        make_current = _function(library, "glXMakeContextCurrent", _SIGNED, _POINTER, _XID, _XID, _POINTER)
        self._make_current = make_current
        self._destroy_context = _function(library, "glXDestroyContext", None, _POINTER, _POINTER)
        self._destroy_pbuffer = _function(library, "glXDestroyPbuffer", None, _POINTER, _XID)
        with self._x_errors() as errors:
            config = self._config(library, current)
            self._context = self._create(config, current)
            # Drivers differ on contexts that have nothing to draw to.
            self._pbuffer = _function(library, "glXCreatePbuffer", _XID, _POINTER, _POINTER, _POINTER)(
                self._display, config, (_SIGNED * 5)(_GLX_PBUFFER_WIDTH, 1, _GLX_PBUFFER_HEIGHT, 1, 0)
            )
        if errors or not self._context or not self._pbuffer:
            raise DeviceError("The graphics driver gives no context that shares textures with Blender's")

    def _config(self, library: ctypes.CDLL, context: int) -> int:
        """The configuration of the framebuffer that the context was made for."""
        query = _function(library, "glXQueryContext", _SIGNED, _POINTER, _POINTER, _SIGNED, _POINTER)
        number, screen, count = _SIGNED(), _SIGNED(), _SIGNED()
        query(self._display, context, _GLX_FBCONFIG_ID, ctypes.byref(number))
        query(self._display, context, _GLX_SCREEN, ctypes.byref(screen))
        choose = _function(library, "glXChooseFBConfig", ctypes.POINTER(_POINTER), _POINTER, _SIGNED, _POINTER, _POINTER)
        found = choose(self._display, screen, (_SIGNED * 3)(_GLX_FBCONFIG_ID, number.value, 0), ctypes.byref(count))
        if not count.value:
            raise DeviceError("The graphics driver does not say how Blender's context was made")
        config = found[0]
        _function(self._x11, "XFree", _SIGNED, _POINTER)(found)
        return int(config or 0)

    def _create(self, config: int, current: int) -> int:
        create_type = ctypes.CFUNCTYPE(_POINTER, _POINTER, _POINTER, _POINTER, _SIGNED, _POINTER)
        create = create_type(self.load("glXCreateContextAttribsARB") or 0)
        for major, minor in VERSIONS:
            attributes = (_SIGNED * 7)(
                *(_GLX_CONTEXT_MAJOR_VERSION, major, _GLX_CONTEXT_MINOR_VERSION, minor),
                *(_GLX_CONTEXT_PROFILE_MASK, _GLX_CONTEXT_CORE_PROFILE_BIT, 0),
            )
            with self._x_errors() as errors:
                context = create(self._display, config, current, True, attributes)
            if context and not errors:
                return int(context)
        return 0

    @contextmanager
    def _x_errors(self) -> Iterator[list[object]]:
        """The X errors of the block; without a handler Xlib would end the process."""
        errors: list[object] = []

        def note(_display: object, event: object) -> int:
            errors.append(event)
            return 0

        handler = _ERROR_HANDLER(note)
        set_handler = _function(self._x11, "XSetErrorHandler", _POINTER, _POINTER)
        synchronize = _function(self._x11, "XSync", _SIGNED, _POINTER, _SIGNED)
        synchronize(self._display, False)
        before = set_handler(ctypes.cast(handler, _POINTER))
        try:
            yield errors
            synchronize(self._display, False)
        finally:
            set_handler(before)

    def load(self, name: str) -> int | None:
        address: int | None = self._load(name.encode())
        return address

    def __enter__(self) -> None:
        if not self._make_current(self._display, self._pbuffer, self._pbuffer, self._context):
            raise DeviceError("The graphics driver does not let a second thread use a context that shares with Blender's")

    def __exit__(self, *_: object) -> None:
        self._make_current(self._display, 0, 0, None)

    def release(self) -> None:
        self.__exit__()
        self._destroy_context(self._display, self._context)
        self._destroy_pbuffer(self._display, self._pbuffer)


class EglContext(SharingContext):
    """On Wayland, and where there is no window system."""

    def __init__(self) -> None:
        library = ctypes.CDLL("libEGL.so.1")
        self._load = _function(library, "eglGetProcAddress", _POINTER, ctypes.c_char_p)
        current = _function(library, "eglGetCurrentContext", _POINTER)()
        self._display = _function(library, "eglGetCurrentDisplay", _POINTER)()
        self.is_offered = bool(current and self._display)
        if not self.is_offered:
            return
        self._bind_api = _function(library, "eglBindAPI", _UNSIGNED, _UNSIGNED)
        self._make_current = _function(library, "eglMakeCurrent", _UNSIGNED, *[_POINTER] * 4)
        self._destroy_context = _function(library, "eglDestroyContext", _UNSIGNED, _POINTER, _POINTER)
        extensions = _function(library, "eglQueryString", ctypes.c_char_p, _POINTER, _SIGNED)(self._display, _EGL_EXTENSIONS)
        if b"EGL_KHR_surfaceless_context" not in (extensions or b""):
            raise DeviceError("The graphics driver gives no context without a window to share textures with Blender's")
        create = _function(library, "eglCreateContext", _POINTER, *[_POINTER] * 4)
        config = self._config(library, current)
        for major, minor in VERSIONS:
            attributes = (_SIGNED * 7)(
                *(_EGL_CONTEXT_MAJOR_VERSION, major, _EGL_CONTEXT_MINOR_VERSION, minor),
                *(_EGL_CONTEXT_PROFILE_MASK, _EGL_CONTEXT_CORE_PROFILE_BIT, _EGL_NONE),
            )
            self._context = create(self._display, config, current, attributes)
            if self._context:
                break
        if not self._context:
            raise DeviceError("The graphics driver gives no context that shares textures with Blender's")

    def _config(self, library: ctypes.CDLL, context: int) -> int | None:
        """The configuration of the framebuffer that the context was made for, None where it was made for any."""
        number, count, config = _SIGNED(), _SIGNED(), _POINTER()
        query = _function(library, "eglQueryContext", _UNSIGNED, _POINTER, _POINTER, _SIGNED, _POINTER)
        query(self._display, context, _EGL_CONFIG_ID, ctypes.byref(number))
        if not number.value:
            return None
        choose = _function(library, "eglChooseConfig", _UNSIGNED, _POINTER, _POINTER, _POINTER, _SIGNED, _POINTER)
        attributes = (_SIGNED * 3)(_EGL_CONFIG_ID, number.value, _EGL_NONE)
        choose(self._display, attributes, ctypes.byref(config), 1, ctypes.byref(count))
        return config.value

    def load(self, name: str) -> int | None:
        address: int | None = self._load(name.encode())
        return address

    def __enter__(self) -> None:
        # Which interface a thread means is a state of its own in EGL.
        self._bind_api(_EGL_OPENGL_API)
        if not self._make_current(self._display, None, None, self._context):
            raise DeviceError("The graphics driver does not let a second thread use a context that shares with Blender's")

    def __exit__(self, *_: object) -> None:
        self._make_current(self._display, None, None, None)

    def release(self) -> None:
        self.__exit__()
        self._destroy_context(self._display, self._context)


def _function(library: ctypes.CDLL, name: str, result: type | None, *arguments: type) -> Any:
    function = getattr(library, name)
    function.restype, function.argtypes = result, arguments
    return function
