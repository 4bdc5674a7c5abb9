"""The programs of Walking Depth Plane, as data."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

from ....addon.render.method import ATTRIBUTES
from ...image_cells import CELL_SIZE
from ...kernel_constants import kernel_constants
from ...programs import ProgramSource
from ...sampling.programs import ANY_KERNEL, SamplingVariant, over_screen

FOLDER = "methods/walking_depth_plane"


def programs_of(variant: SamplingVariant) -> Iterator[ProgramSource]:
    """The programs of a frame."""
    yield from variant.programs()
    yield variant.over_balls("ahead", f"{FOLDER}/ahead.frag", **kernel_constants(variant.kernel))
    for name in ("begin_walk", "enter", "advance", "ask", "walking"):
        yield over_screen(name, f"{FOLDER}/{name}.frag")
    yield over_screen("cells_from_walks", f"{FOLDER}/cells_from_walks.frag", CELL_SIZE=CELL_SIZE)


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    subsets = [chosen for count in range(len(ATTRIBUTES) + 1) for chosen in combinations(ATTRIBUTES, count)]
    for kernel, attributes in product(ANY_KERNEL, subsets):
        yield from programs_of(SamplingVariant(kernel, attributes))
