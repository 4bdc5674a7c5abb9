"""What the pixels of an image ask for, summed up by squares of it, level by level; see lib/cells.glsl."""

from __future__ import annotations

import moderngl

CELL_SIZE = 8
"""Side of the smallest cells, pixels."""
CELL_FACTOR = 4
"""Cells along the side of one of the next level."""


class CellTargets:
    """The cells of an image of one size.

    Attributes
    ----------
    across, down
        The numbers of the smallest cells along the image's sides.
    levels, framebuffers
        A texture and its framebuffer for each level, from the smallest cells to the whole image.
    factors
        How many pixels, or cells of the level before, lie along a cell's side.
    """

    def __init__(self, gl: moderngl.Context, size: tuple[int, int]) -> None:
        sizes = [size]
        for factor in (CELL_SIZE, CELL_FACTOR, CELL_FACTOR):
            sizes.append((-(-sizes[-1][0] // factor), -(-sizes[-1][1] // factor)))
        self.across, self.down = sizes[1]
        self.levels = [plain(gl.texture(level_size, 2, dtype="f4")) for level_size in (*sizes[1:], (1, 1))]
        self.framebuffers = [gl.framebuffer([texture]) for texture in self.levels]
        self.factors = [CELL_SIZE, CELL_FACTOR, CELL_FACTOR, max(sizes[3])]

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """By sampler name."""
        return {f"cells_{level}_tx": texture for level, texture in enumerate(self.levels)}


def plain(texture: moderngl.Texture) -> moderngl.Texture:
    """The texture, to be read texel by texel."""
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
