"""The programs of Equal Interval, as data."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

from ....addon.render.method import ATTRIBUTES
from ...image_cells import CELL_SIZE
from ...programs import ProgramSource
from ...sampling.programs import ANY_KERNEL, SamplingVariant, over_screen

FOLDER = "methods/equal_interval"


def programs_of(variant: SamplingVariant) -> Iterator[ProgramSource]:
    """The programs of a frame."""
    yield from variant.programs()
    yield variant.over_balls("next", f"{FOLDER}/next.frag")
    yield over_screen("cells_from_march", f"{FOLDER}/cells_from_march.frag", CELL_SIZE=CELL_SIZE)
    for name in ("begin_march", "place", "advance", "unfinished"):
        yield over_screen(name, f"{FOLDER}/{name}.frag")


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    subsets = [chosen for count in range(4) for chosen in combinations(ATTRIBUTES, count)]
    for kernel, attributes, culling in product(ANY_KERNEL, subsets, (False, True)):
        yield from programs_of(SamplingVariant(kernel, attributes, culling))
