"""The programs that methods share that sample, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ...addon.fluid.density_profile import DensityProfile
from ...addon.fluid.kernels import KERNELS, Kernel
from ...addon.render.method import Attribute
from ..ball_textures import BALL_TEXTURE_WIDTH
from ..image_cells import CELL_FACTOR, CELL_SIZE
from ..kernel_constants import kernel_constants
from ..programs import ProgramSource, output_constants

FOLDER = "lib/sampling"
ANY_KERNEL: tuple[Kernel, ...] = (*KERNELS.values(), DensityProfile([1, 0]))
"""Of each kind that programs differ by; all tables are one."""


@dataclass(frozen=True)
class SamplingVariant:
    """What the programs of a frame depend on.

    Attributes
    ----------
    kernel
        The density kernel.
    attributes
        What is found beside depth and normal, in the order of ATTRIBUTES.
    ball_culling
        Whether a ball is left out that reaches no sample of the pixels around it.
    """

    kernel: Kernel
    attributes: tuple[Attribute, ...] = ()
    ball_culling: bool = True

    def programs(self) -> Iterator[ProgramSource]:
        """All of them."""
        attributes = self._attributes()
        kernel = kernel_constants(self.kernel)
        yield self.over_balls("density", f"{FOLDER}/density.frag", **kernel)
        yield self.over_balls("gather", f"{FOLDER}/gather.frag", **kernel, **attributes)
        yield self.over_balls("barrier", "lib/kernel_sphere.frag", KERNEL_SPHERES=1, BALL_CULLING=0)
        if "ball" in self.attributes:
            yield self.over_balls("dominant", f"{FOLDER}/dominant.frag", **kernel)
        for name in ("begin", "start", "count", "guess", "narrow", "found"):
            yield over_screen(name, f"{FOLDER}/{name}.frag")
        yield over_screen("finish", f"{FOLDER}/finish.frag", **attributes)
        yield over_screen("cells_from_samples", f"{FOLDER}/cells_from_samples.frag", CELL_SIZE=CELL_SIZE)
        yield over_screen("cells_from_cells", "lib/cells_from_cells.frag")

    def over_balls(self, name: str, fragment: str, **constants: object) -> ProgramSource:
        """A program that draws each ball's rectangle."""
        drawn = {
            "BALL_TEXTURE_WIDTH": BALL_TEXTURE_WIDTH,
            "TIGHT_RECTANGLES": 1,
            "BALL_CULLING": int(self.ball_culling),
            "KERNEL_SPHERES": 0,
            "CELL_SIZE": CELL_SIZE,
            "CELL_FACTOR": CELL_FACTOR,
        }
        return ProgramSource(
            name, f"{FOLDER}/billboard.vert", fragment, constants=tuple(sorted({**drawn, **constants}.items()))
        )

    def _attributes(self) -> dict[str, object]:
        """Which attributes there are, and at which places sums and results are written."""
        summed = [name for name in self.attributes if name != "ball"]
        return output_constants(self.attributes) | {f"{name.upper()}_SUM": place for place, name in enumerate(summed, start=1)}


def over_screen(name: str, fragment: str, **constants: object) -> ProgramSource:
    """A program that draws every pixel once."""
    return ProgramSource(name, "lib/screen.vert", fragment, constants=tuple(sorted(constants.items())))
