"""A program and what it reads, ready to draw."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from .context import GpuContext
from .programs import ProgramSource


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
        self._without_buffers = self._gl.vertex_array(self._program, [])
        self._on_buffers: dict[tuple[moderngl.Buffer, str, str], moderngl.VertexArray] = {}
        self.textures: dict[str, moderngl.Texture] = {}

    def set_uniforms(self, values: Mapping[str, object]) -> None:
        """Set those of `values` that the program uses."""
        for name, value in values.items():
            if name in self._program:
                self._program[name] = value

    def use_textures(self, textures: Mapping[str, moderngl.Texture]) -> None:
        """Bind `textures` and the step's own, as far as the program reads them."""
        used = [name for name in {**self.textures, **textures} if name in self._program]
        for unit, name in enumerate(used):
            (textures.get(name) or self.textures[name]).use(unit)
            self._program[name] = unit

    def vertex_array(self, buffer: moderngl.Buffer | None = None, layout: str = "", name: str = "") -> moderngl.VertexArray:
        """The program's inputs: none, or `name` from a buffer with the layout that moderngl calls so."""
        if buffer is None:
            return self._without_buffers
        key = (buffer, layout, name)
        if key not in self._on_buffers:
            self._on_buffers[key] = self._gl.vertex_array(self._program, [(buffer, layout, name)])
        return self._on_buffers[key]
