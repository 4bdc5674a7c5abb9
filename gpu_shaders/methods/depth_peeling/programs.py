"""The OpenGL programs of Depth Peeling."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from ....addon.fluid.kernels import KERNELS
from ...programs import ProgramSource
from .method import _BALL_TEXTURE_WIDTH, _FOLDER, LIST_LENGTH, kernel_constants

_VERTEX_SHADERS = {
    **dict.fromkeys(("begin", "search_list", "search_sum", "finish"), "screen"),
    **dict.fromkeys(("peel", "sum", "gather"), "sphere"),
}


def all_programs() -> Iterator[ProgramSource]:
    """Every program for every kernel, with and without colours."""
    for kernel, with_colors in product(KERNELS.values(), (0, 1)):
        constants = {
            "BALL_TEXTURE_WIDTH": _BALL_TEXTURE_WIDTH,
            "LIST_LENGTH": LIST_LENGTH,
            "WITH_COLORS": with_colors,
            **kernel_constants(kernel),
        }
        yield _program("begin_again", "screen", "begin", {**constants, "AGAIN": 1})
        for fragment, vertex in _VERTEX_SHADERS.items():
            yield _program(fragment, vertex, fragment, constants)


def _program(name: str, vertex: str, fragment: str, constants: dict[str, object]) -> ProgramSource:
    files = f"{_FOLDER}/{vertex}.vert", f"{_FOLDER}/{fragment}.frag"
    return ProgramSource(name, *files, constants=tuple(sorted(constants.items())))
