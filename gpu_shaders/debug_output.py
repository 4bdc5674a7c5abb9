"""What the driver has to say about how OpenGL is used (the extension KHR_debug)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, Protocol

import moderngl

_DEBUG_OUTPUT = 0x92E0
_DEBUG_OUTPUT_SYNCHRONOUS = 0x8242
_MAX_DEBUG_MESSAGE_LENGTH = 0x9143
_DONT_CARE = 0x1100
_ALWAYS_TOLD = {0x824C: "error", 0x824D: "deprecated", 0x824E: "undefined behavior", 0x824F: "portability"}
_OTHER = 0x8251
_HIGH, _MEDIUM, _NOTIFICATION = 0x9146, 0x9147, 0x826B
# More than any driver keeps; a driver that has lost its mind must not hold the caller.
_MOST_MESSAGES = 1024


class LoadFunction(Protocol):
    """Gives an OpenGL function by its name, with the types of its arguments and of its result."""

    def __call__(self, name: str, *arguments: type, result: type | None = None) -> Callable[..., Any]: ...


class DebugOutput:
    """Collects the messages of a context; made and used on its thread.

    It collects errors, undefined behaviour, deprecated and unportable use, and what else has a high or medium severity; not
    notifications, nor notes on performance, which llvmpipe makes on every shader. The driver filters, because its log is short
    (ten messages in Mesa). Mesa also speaks in contexts that were not made for debugging, the only ones that glcontext makes;
    other drivers may be silent there.

    Parameters
    ----------
    gl
        The context; without KHR_debug, which OpenGL 4.3 contains, there are no messages.
    load
        Gives its functions.
    """

    def __init__(self, gl: moderngl.Context, load: LoadFunction) -> None:
        self._is_offered = gl.version_code >= 430 or "GL_KHR_debug" in gl.extensions
        if not self._is_offered:
            return
        self._get_message_log = load("glGetDebugMessageLog", *[ctypes.c_uint] * 2, *[ctypes.c_void_p] * 6, result=ctypes.c_uint)
        length = ctypes.c_int()
        load("glGetIntegerv", ctypes.c_uint, ctypes.c_void_p)(_MAX_DEBUG_MESSAGE_LENGTH, ctypes.addressof(length))
        self._text = ctypes.create_string_buffer(length.value)
        self._choose(load)
        gl.enable_direct(_DEBUG_OUTPUT)
        # A message then belongs to the work after which it is found.
        gl.enable_direct(_DEBUG_OUTPUT_SYNCHRONOUS)

    def _choose(self, load: LoadFunction) -> None:
        """Tell the driver which messages to log; later rules override earlier ones."""
        control = load("glDebugMessageControl", *[ctypes.c_uint] * 4, ctypes.c_void_p, ctypes.c_ubyte)
        control(_DONT_CARE, _DONT_CARE, _DONT_CARE, 0, None, False)
        for kind in _ALWAYS_TOLD:
            control(_DONT_CARE, kind, _DONT_CARE, 0, None, True)
        for severity in (_HIGH, _MEDIUM):
            control(_DONT_CARE, _OTHER, severity, 0, None, True)
        control(_DONT_CARE, _DONT_CARE, _NOTIFICATION, 0, None, False)

    def messages(self) -> list[str]:
        """The messages since the last call, the oldest first."""
        if not self._is_offered:
            return []
        found: list[str] = []
        kind = ctypes.c_uint()
        wanted = (None, ctypes.addressof(kind), None, None, None, ctypes.addressof(self._text))
        while len(found) < _MOST_MESSAGES and self._get_message_log(1, len(self._text), *wanted):
            text = self._text.value.decode(errors="replace").strip()
            found.append(f"{_ALWAYS_TOLD.get(kind.value, 'other')}: {text}")
        return found
