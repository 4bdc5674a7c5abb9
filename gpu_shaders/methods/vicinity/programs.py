"""The programs of Vicinity, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

from ....addon.fluid.kernels import KERNELS, Kernel, PolynomialKernel
from ....addon.render.method import ATTRIBUTES, Attribute
from ...kernel_constants import kernel_constants
from ...programs import ProgramSource, output_constants

FOLDER = "methods/vicinity"

MET_LENGTH = 16
"""Balls that an exact search has room for; where there are more they are computed anew at each step."""

# Loops end by what they do; these numbers only keep a faulty driver from looping for ever.
_MOST = {"MOST_ENTRIES": "0x7fffffffu", "MOST_STEPS": "1000000u"}


@dataclass(frozen=True)
class Variant:
    """What the programs of a frame depend on.

    Attributes
    ----------
    kernel
        The density kernel.
    with_weights
        Whether the balls' weights differ.
    with_starts
        Whether a ray may start inside the fluid, or a ball has a negative weight.
    exact
        Whether the surface is found by safe steps, else by samples.
    attributes
        What is found beside depth and normal, in the order of ATTRIBUTES.
    """

    kernel: Kernel
    with_weights: bool = False
    with_starts: bool = False
    exact: bool = False
    attributes: tuple[Attribute, ...] = ()

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        kernel = kernel_constants(self.kernel)
        outputs = self._outputs()
        programs = [
            self._over_balls("kernel", KERNEL_SPHERES=1),
            _program("begin", "lib/screen.vert", **outputs, WITH_STARTS=int(self.with_starts)),
            self._over_balls("cast", **kernel, **outputs, **_MOST, EXACT=int(self.exact), MET_LENGTH=MET_LENGTH),
        ]
        if self.with_starts:
            programs.append(self._over_balls("start", **kernel, STARTS_ONLY=1))
        return {program.name: program for program in programs}

    def _over_balls(self, name: str, **constants: object) -> ProgramSource:
        """Draw each ball's rectangle."""
        common = {"TIGHT_RECTANGLES": 1, "WITH_WEIGHTS": int(self.with_weights), "KERNEL_SPHERES": 0, "STARTS_ONLY": 0}
        return _program(name, f"{FOLDER}/sphere.vert", **{**common, **constants})

    def _outputs(self) -> dict[str, object]:
        return {**output_constants(self.attributes), "BARRIER_LOCATION": 2 + len(self.attributes)}


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    subsets = [chosen for count in range(4) for chosen in combinations(ATTRIBUTES, count)]
    flags = (False, True)
    for kernel, weights, starts, exact, attributes in product(KERNELS.values(), flags, flags, flags, subsets):
        if isinstance(kernel, PolynomialKernel) or not exact:
            yield from Variant(kernel, weights, starts, exact, attributes).programs().values()


def _program(name: str, vertex: str, **constants: object) -> ProgramSource:
    return ProgramSource(name, vertex, f"{FOLDER}/{name}.frag", constants=tuple(sorted(constants.items())))
