"""The state of OpenGL that Blender's own drawing relies on, read past Blender in a draw handler."""

from __future__ import annotations

import ctypes

import gpu
from gpu_extras.batch import batch_for_shader

State = dict[str, tuple[int, ...]]

_NUMBERS = {
    "DRAW_FRAMEBUFFER_BINDING": 0x8CA6,
    "READ_FRAMEBUFFER_BINDING": 0x8CAA,
    "VIEWPORT": 0x0BA2,
    "SCISSOR_BOX": 0x0C10,
    "DEPTH_FUNC": 0x0B74,
    "DEPTH_WRITEMASK": 0x0B72,
    "DEPTH_RANGE": 0x0B70,
    "CULL_FACE_MODE": 0x0B45,
    "FRONT_FACE": 0x0B46,
    "POLYGON_MODE": 0x0B40,
    "PROVOKING_VERTEX": 0x8E4F,
    "COLOR_WRITEMASK": 0x0C23,
    "BLEND_SRC_RGB": 0x80C9,
    "BLEND_DST_RGB": 0x80C8,
    "BLEND_SRC_ALPHA": 0x80CB,
    "BLEND_DST_ALPHA": 0x80CA,
    "BLEND_EQUATION_RGB": 0x8009,
    "STENCIL_FUNC": 0x0B92,
    "STENCIL_WRITEMASK": 0x0B98,
    "CURRENT_PROGRAM": 0x8B8D,
    "VERTEX_ARRAY_BINDING": 0x85B5,
    "ACTIVE_TEXTURE": 0x84E0,
    "PIXEL_PACK_BUFFER_BINDING": 0x88ED,
    "PIXEL_UNPACK_BUFFER_BINDING": 0x88EF,
    "PACK_ALIGNMENT": 0x0D05,
    "UNPACK_ALIGNMENT": 0x0CF5,
}
_SWITCHES = {
    "DEPTH_TEST": 0x0B71,
    "SCISSOR_TEST": 0x0C11,
    "CULL_FACE": 0x0B44,
    "FRAMEBUFFER_SRGB": 0x8DB9,
    "STENCIL_TEST": 0x0B90,
    "BLEND": 0x0BE2,
    "MULTISAMPLE": 0x809D,
    "PRIMITIVE_RESTART": 0x8F9D,
    "RASTERIZER_DISCARD": 0x8C89,
    "CLIP_DISTANCE0": 0x3000,
    "COLOR_LOGIC_OP": 0x0BF2,
    "POLYGON_OFFSET_FILL": 0x8037,
}

# Four numbers are the most that any of these has.
_MOST = 4


class StateReader:
    """Reads the state in draw handlers, where Blender runs on OpenGL.

    Blender's module sets much only when it draws next, so that something is drawn first, which is nowhere to be seen.
    """

    def __init__(self) -> None:
        self._shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        self._batch = batch_for_shader(self._shader, "TRIS", {"pos": [(0, 0, 0)] * 3})

    def read_into(self, states: list[State]) -> None:
        """Append the state of now; a draw handler."""
        self._shader.bind()
        self._shader.uniform_float("color", (0, 0, 0, 0))
        self._batch.draw(self._shader)
        states.append(read_state())


def read_state() -> State:
    """What the current context has."""
    library = ctypes.CDLL("libGL.so.1")
    library.glIsEnabled.restype = ctypes.c_ubyte
    state: State = {name: (library.glIsEnabled(number),) for name, number in _SWITCHES.items()}
    for name, number in _NUMBERS.items():
        values = (ctypes.c_int * _MOST)()
        library.glGetIntegerv(number, values)
        state[name] = tuple(values)
    return state


def changes(before: State, after: State) -> dict[str, tuple[tuple[int, ...], tuple[int, ...]]]:
    """What differs, with both values."""
    return {name: (before[name], after[name]) for name in before if before[name] != after[name]}
