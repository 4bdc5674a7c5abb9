"""The programs of Surface Particles, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

from ....addon.fluid.kernels import KERNELS, Kernel, PolynomialKernel
from ....addon.render.method import ATTRIBUTES, Attribute
from ...kernel_constants import kernel_constants
from ...programs import ROW_TEXTURE_WIDTH, ProgramSource, output_constants

FOLDER = "methods/surface_particles"

THREADS = 64
"""Of a group that works on the grid."""

# Loops end by what they do; these numbers only keep a faulty driver from looping for ever.
_MOST: dict[str, object] = {"MOST_ENTRIES": "0x1000000u", "MOST_LEVELS": "256", "MOST_MEMBERS": "0x1000000u"}

_COMMON: dict[str, object] = {"ROW_TEXTURE_WIDTH": ROW_TEXTURE_WIDTH, **_MOST}


@dataclass(frozen=True)
class MotionPrograms:
    """What moves particles on a fluid of one density kernel."""

    kernel: PolynomialKernel

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        kernel = kernel_constants(self.kernel)
        return {name: _over_particles(name, **kernel) for name in ("flow", "settle", "spread", "note")}


@dataclass(frozen=True)
class DrawPrograms:
    """What draws particles.

    Attributes
    ----------
    kernel
        The density kernel.
    with_starts
        Whether a ray may start inside the fluid.
    attributes
        What is found beside depth and normal, in the order of ATTRIBUTES.
    """

    kernel: PolynomialKernel
    with_starts: bool = False
    attributes: tuple[Attribute, ...] = ()

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        kernel, starts = kernel_constants(self.kernel), {"WITH_STARTS": int(self.with_starts)}
        over_discs = {name: _over_discs(name, **starts) for name in ("front", "blend")}
        screen = "lib/screen.vert"
        programs = {**over_discs, "finish": _program("finish", screen, **kernel, **starts, **self._outputs())}
        return {**programs, "start": _program("start", screen, **kernel)} if self.with_starts else programs

    def _outputs(self) -> dict[str, object]:
        return {**output_constants(self.attributes), "BEYOND_LOCATION": 2 + len(self.attributes)}


def programs_of(kernel: Kernel) -> list[ProgramSource]:
    """What moves and draws particles on a fluid of a density kernel that is a polynomial; none of it for others."""
    if not isinstance(kernel, PolynomialKernel):
        return []
    return [*MotionPrograms(kernel).programs().values(), *DrawPrograms(kernel).programs().values()]


def image_programs() -> dict[str, ProgramSource]:
    """What finds neighbours in an image, by name."""
    over_image = {name: _program(name, vertex=f"{FOLDER}/{name}.vert") for name in ("mark", "push")}
    return {**over_image, "collect": _over_particles("collect")}


def grid_programs() -> dict[str, ProgramSource]:
    """What finds neighbours in a grid, by name."""
    constants = _sorted(THREADS=THREADS)
    names = ("grid_count", "grid_allot", "grid_fill", "grid_sort", "grid_press")
    return {name: ProgramSource(name, compute=f"{FOLDER}/{name}.comp", constants=constants) for name in names}


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    yield from image_programs().values()
    yield from grid_programs().values()
    subsets = [chosen for count in range(len(ATTRIBUTES) + 1) for chosen in combinations(ATTRIBUTES, count)]
    for kernel in KERNELS.values():
        if isinstance(kernel, PolynomialKernel):
            yield from MotionPrograms(kernel).programs().values()
            for with_starts, attributes in product((False, True), subsets):
                yield from DrawPrograms(kernel, with_starts, attributes).programs().values()


def _over_discs(name: str, **constants: object) -> ProgramSource:
    """A rectangle for each particle."""
    return _program(name, vertex=f"{FOLDER}/disc.vert", TIGHT_RECTANGLES=1, **constants)


def _over_particles(name: str, **constants: object) -> ProgramSource:
    """A fragment for each particle."""
    return _program(name, vertex="lib/screen.vert", **constants)


def _program(name: str, vertex: str, **constants: object) -> ProgramSource:
    return ProgramSource(name, vertex, f"{FOLDER}/{name}.frag", constants=_sorted(**constants))


def _sorted(**constants: object) -> tuple[tuple[str, object], ...]:
    return tuple(sorted({**_COMMON, **constants}.items()))
