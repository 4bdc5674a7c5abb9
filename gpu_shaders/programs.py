"""What an OpenGL program is made of, as data: known without a driver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .glsl import Source


@dataclass(frozen=True)
class ProgramSource:
    """One program.

    Attributes
    ----------
    name
        For messages.
    vertex, geometry, fragment
        Shader files below gpu_shaders/; None where the program has no such stage.
    constants
        Name and value of each constant, sorted.
    varyings
        What transform feedback captures, in order.
    """

    name: str
    vertex: str
    fragment: str | None = None
    geometry: str | None = None
    constants: tuple[tuple[str, object], ...] = ()
    varyings: tuple[str, ...] = ()

    def sources(self) -> dict[str, Source]:
        """The stages' texts as the driver gets them, by "vertex", "geometry" and "fragment"."""
        paths: Mapping[str, str | None] = {"vertex": self.vertex, "geometry": self.geometry, "fragment": self.fragment}
        return {stage: Source(path, dict(self.constants)) for stage, path in paths.items() if path is not None}
