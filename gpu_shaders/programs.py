"""OpenGL programs as data: what a method compiles can be listed, and checked, without OpenGL."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..addon.fluid.passes import DEPTH_BACKGROUND
from ..addon.render.method import Attribute
from .glsl import Source, explain

ROW_TEXTURE_WIDTH = 4096
"""Texels on a line of those textures that shaders read row by row."""

_RULER = re.compile(r"[=-]*")


def output_constants(attributes: Sequence[Attribute]) -> dict[str, object]:
    """What lib/outputs.glsl wants to know: which attributes there are beside depth and normal, in the order of ATTRIBUTES, and
    their locations.
    """
    return {
        "DEPTH_BACKGROUND": f"float({DEPTH_BACKGROUND!r})",
        "WITH_COLORS": int("color" in attributes),
        "WITH_VELOCITIES": int("velocity" in attributes),
        "WITH_BALLS": int("ball" in attributes),
        **{f"{name.upper()}_LOCATION": location for location, name in enumerate(attributes, start=2)},
    }


@dataclass(frozen=True)
class ProgramSource:
    """One OpenGL program.

    Attributes
    ----------
    name
        What the method calls it.
    vertex, geometry, fragment, compute
        Shader files, as paths below gpu_shaders/; None where the program has no such stage. A compute shader is alone.
    constants
        Names and values of the ``#define`` lines that all stages get, sorted by name.
    varyings
        Outputs that transform feedback captures, in the order in which they are written.
    """

    name: str
    vertex: str | None = None
    fragment: str | None = None
    geometry: str | None = None
    compute: str | None = None
    constants: tuple[tuple[str, object], ...] = ()
    varyings: tuple[str, ...] = ()

    @property
    def files(self) -> dict[str, str]:
        """Paths by stage ("vertex", "geometry", "fragment", "compute"), in their order; only those that there are."""
        stages = {"vertex": self.vertex, "geometry": self.geometry, "fragment": self.fragment, "compute": self.compute}
        return {stage: path for stage, path in stages.items() if path is not None}

    def sources(self) -> dict[str, Source]:
        """What the driver gets, by stage; DeviceError where a file cannot be read."""
        constants = dict(self.constants)
        version = 330 if self.compute is None else 430
        return {stage: Source(path, constants, version) for stage, path in self.files.items()}

    def explain(self, log: str) -> str:
        """What moderngl reports of a driver that rejects the program, on one line and with the names of the files."""
        headings: dict[str, Source] = {}
        for stage, source in self.sources().items():
            # moderngl's heading over what a compiler says, and the one in the logs of some linkers.
            headings |= {f"{stage}_shader": source, f"{stage.capitalize()} info": source}
        lines = (line.strip() for line in explain(log, headings).splitlines())
        return " ".join(line for line in lines if not _RULER.fullmatch(line))
