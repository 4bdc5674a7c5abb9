"""A compute shader and what it needs, ready to run."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from .context import GpuContext
from .programs import ProgramSource

MOST_GROUPS = 32768
"""Groups of threads in a line; more are put into several lines. OpenGL 4.3 guarantees twice as many."""


class ComputeStep:
    """A compute shader of a method, with the uniforms that stay the same for a frame."""

    def __init__(self, context: GpuContext, source: ProgramSource) -> None:
        self._gl = context.gl
        self._shader = context.compute_shader(source)
        self._names = frozenset(self._shader)
        if self._shader.extra is None:
            self._shader.extra = {}
        # What the program has; others may use it as well.
        self._values: dict[str, object] = self._shader.extra

    def set_uniforms(self, values: Mapping[str, object]) -> None:
        """Set those of `values` that the shader uses and does not have yet."""
        for name in self._names & values.keys():
            if name not in self._values or self._values[name] != values[name]:
                self._shader[name] = self._values[name] = values[name]

    def use_textures(self, textures: Mapping[str, moderngl.Texture]) -> None:
        """Bind textures by sampler name; image and storage bindings have numbers of their own."""
        for unit, (name, texture) in enumerate(textures.items()):
            self.set_uniforms({name: unit})
            texture.use(unit)

    def run(self, columns: int, rows: int = 1) -> None:
        """Run groups of threads; what they write can be read by the next step."""
        self._shader.run(columns, rows)
        self._gl.memory_barrier()

    def run_in_lines(self, groups: int) -> None:
        """Run that many groups, and maybe some more, in lines of at most MOST_GROUPS."""
        self.run(min(groups, MOST_GROUPS), max(1, -(-groups // MOST_GROUPS)))

    def run_indirect(self, counts: moderngl.Buffer, offset: int) -> None:
        """Run as many groups as the three numbers in a buffer say, from `offset` bytes on."""
        self._shader.run_indirect(counts, offset)
        self._gl.memory_barrier()
