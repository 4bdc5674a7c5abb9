"""The programs of Glyphs, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from ....addon.render.method import ATTRIBUTES, Attribute
from ...programs import ROW_TEXTURE_WIDTH, ProgramSource, output_constants

FOLDER = "methods/glyphs"


@dataclass(frozen=True)
class Variant:
    """What the programs of a frame depend on.

    Attributes
    ----------
    are_spheres
        Else ellipsoids.
    attributes
        What is found beside depth and normal, in the order of ATTRIBUTES.
    """

    are_spheres: bool
    attributes: tuple[Attribute, ...] = ()

    @property
    def _constants(self) -> dict[str, object]:
        return {"ELLIPSOIDS": int(not self.are_spheres), "ROW_TEXTURE_WIDTH": ROW_TEXTURE_WIDTH}

    def nearest(self) -> ProgramSource:
        """Finds the nearest glyph of each pixel."""
        constants = tuple(sorted(self._constants.items()))
        return ProgramSource("nearest", f"{FOLDER}/glyph.vert", f"{FOLDER}/glyph.frag", constants=constants)

    def finish(self) -> ProgramSource:
        """Writes the surface."""
        constants = {**self._constants, **output_constants(self.attributes)}
        return ProgramSource("finish", "lib/screen.vert", f"{FOLDER}/finish.frag", constants=tuple(sorted(constants.items())))


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    for are_spheres in (False, True):
        yield Variant(are_spheres).nearest()
        for count in range(len(ATTRIBUTES) + 1):
            yield from (Variant(are_spheres, chosen).finish() for chosen in combinations(ATTRIBUTES, count))
