"""A program and what it reads, ready to draw."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from .buffer_texture import BufferTexture
from .context import GpuContext
from .programs import ProgramSource

Texture = moderngl.Texture | BufferTexture


class Step:
    """A program of a method, with the uniforms and textures that stay the same for a frame.

    Attributes
    ----------
    textures
        What it reads besides the textures of each draw, by sampler name.
    """

    def __init__(self, context: GpuContext, source: ProgramSource) -> None:
        self._gl = context.gl
        self._program = context.program(source)
        self._array = self._gl.vertex_array(self._program, [])
        names = [name for name in self._program if name.endswith("_tx")]
        self._units = {name: unit for unit, name in enumerate(names)}
        context.set_sampler_units(self._program, self._units)
        self.textures: dict[str, Texture] = {}

    def set_uniforms(self, values: Mapping[str, object]) -> None:
        """Set those of `values` that the program uses."""
        for name, value in values.items():
            if name in self._program:
                self._program[name] = value

    def use_textures(self, textures: Mapping[str, Texture]) -> None:
        """Bind what the program reads of `textures` and its own."""
        for name, unit in self._units.items():
            (textures.get(name) or self.textures[name]).use(unit)

    def vertex_array(self, *inputs: tuple[moderngl.Buffer, str, str]) -> moderngl.VertexArray:
        """The program with vertices that come from buffers, or from nowhere."""
        return self._gl.vertex_array(self._program, list(inputs)) if inputs else self._array

    def draw(self, framebuffer: moderngl.Framebuffer, mode: int, vertices: int, textures: Mapping[str, Texture]) -> None:
        """Draw vertices that come from nowhere."""
        self.use_textures(textures)
        framebuffer.use()
        self._array.render(mode, vertices)

    def draw_plainly(self, framebuffer: moderngl.Framebuffer, textures: Mapping[str, Texture]) -> None:
        """Draw every pixel of a framebuffer once, whatever others have left switched on."""
        self._gl.enable_only(moderngl.NOTHING)
        framebuffer.viewport = (0, 0, *framebuffer.size)
        self.draw(framebuffer, moderngl.TRIANGLES, 3, textures)
