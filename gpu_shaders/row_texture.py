"""Arrays that shaders read row by row, as textures of OpenGL 3.3, whose buffer textures may be short."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from .programs import ROW_TEXTURE_WIDTH

Rows = npt.NDArray[np.float32] | npt.NDArray[np.int32] | npt.NDArray[np.uint32]


def row_texture(gl: moderngl.Context, rows: Rows) -> moderngl.Texture:
    """(M, components) of floats or integers of 32 bits as a texture with one texel a row, left to right and on the next line
    after ROW_TEXTURE_WIDTH.
    """
    lines = max(-(-len(rows) // ROW_TEXTURE_WIDTH), 1)
    padded = np.zeros((lines * ROW_TEXTURE_WIDTH, rows.shape[1]), rows.dtype)
    padded[: len(rows)] = rows
    texture = gl.texture((ROW_TEXTURE_WIDTH, lines), rows.shape[1], padded, dtype=f"{rows.dtype.kind}4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
