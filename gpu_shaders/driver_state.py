"""What the driver answers when it is asked how it is: errors, and whether the context is lost."""

from __future__ import annotations

import ctypes

import moderngl

from .debug_output import LoadFunction

CONTEXT_LOST = "GL_CONTEXT_LOST"
_ERRORS = {
    0x0500: "GL_INVALID_ENUM",
    0x0501: "GL_INVALID_VALUE",
    0x0502: "GL_INVALID_OPERATION",
    0x0503: "GL_STACK_OVERFLOW",
    0x0504: "GL_STACK_UNDERFLOW",
    0x0505: "GL_OUT_OF_MEMORY",
    0x0506: "GL_INVALID_FRAMEBUFFER_OPERATION",
    0x0507: CONTEXT_LOST,
}
# A lost context may repeat its error for ever.
_MOST_ERRORS = 16


class DriverState:
    """Asks the driver of a context; made and used on its thread.

    A context is lost when the graphics processor or its driver is reset: after a hang, an update of the driver, or sleep.

    Parameters
    ----------
    gl
        The context.
    load
        Gives its functions.
    """

    def __init__(self, gl: moderngl.Context, load: LoadFunction) -> None:
        self._get_error = load("glGetError", result=ctypes.c_uint)
        self._get_reset_status = None
        if gl.version_code >= 450 or "GL_KHR_robustness" in gl.extensions:
            self._get_reset_status = load("glGetGraphicsResetStatus", result=ctypes.c_uint)
        elif "GL_ARB_robustness" in gl.extensions:
            self._get_reset_status = load("glGetGraphicsResetStatusARB", result=ctypes.c_uint)

    def errors(self) -> list[str]:
        """The names of the errors since the last call; CONTEXT_LOST is among them where the context is lost."""
        found: list[str] = []
        while len(found) < _MOST_ERRORS and (code := self._get_error()):
            name = _ERRORS.get(code, f"error {code:#06x}")
            if name in found:
                break
            found.append(name)
        # Every status but GL_NO_ERROR is some kind of reset.
        if self._get_reset_status is not None and self._get_reset_status() and CONTEXT_LOST not in found:
            found.append(CONTEXT_LOST)
        return found
