"""The programs of Tile Lists, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

from ....addon.fluid.kernels import KERNELS, Kernel
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.render.method import Attribute
from ...kernel_constants import kernel_constants
from ...programs import ProgramSource

FOLDER = "methods/tile_lists"
CELL_SIZE = 4
"""Side of the cells in which kernel spheres hide what is behind, pixels."""
OCCLUSION_LEVELS = 16
"""Of the pyramid over the cells, at most."""
KERNEL_SHARES = 256
"""Parts of the table of kernel radii."""
LARGE_OCCLUDERS = 4096
"""Kernel spheres that groups of threads draw together; any more are drawn by single threads."""
THREADS = 128
"""Of a group of the steps that have a thread for each ball."""
SHORT_LIST = 32
"""Entries of a tile's list that one thread sorts."""
SOFTWARE_SHORT_LIST = 512
"""The same in software, where groups of threads gain nothing and waiting for one another costs."""
LIST_LENGTH = 32
"""Balls that a ray may be in before it walks without a list of them."""

# Loops end by what they do; these numbers only keep a faulty driver from looping for ever.
_MOST = {"MOST_ENTRIES": "0x7fffffffu", "MOST_WINDOWS": "1000000u", "MOST_STEPS": "1000000u"}


@dataclass(frozen=True)
class Variant:
    """What the programs of a frame depend on.

    Attributes
    ----------
    kernel
        The density kernel.
    with_weights
        Whether the balls' weights differ.
    attributes
        What is wanted beside depth and normal.
    list_length
        Balls that a ray may be in before it walks without a list of them.
    short_list
        Entries of a tile's list that one thread sorts.
    """

    kernel: Kernel
    with_weights: bool = False
    attributes: frozenset[Attribute] = frozenset()
    list_length: int = LIST_LENGTH
    short_list: int = SHORT_LIST

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        weights = {"WITH_WEIGHTS": int(self.with_weights)}
        cells = {"CELL_SIZE": CELL_SIZE, "OCCLUSION_LEVELS": OCCLUSION_LEVELS, "THREADS": THREADS}
        spheres = {**weights, **cells, "TIGHT_RECTANGLES": 1}
        drawing = {
            **spheres,
            "KERNEL_SHARES": KERNEL_SHARES,
            "LARGE_OCCLUDERS": LARGE_OCCLUDERS,
            "DISTANCE_ERROR": "1e-6",
        }
        programs = (
            _program("occlude", **drawing),
            _program("occlude_large", **drawing),
            _program("pyramid", **cells),
            _program("cull", **spheres),
            _program("scan"),
            _program("fill", **cells),
            _program("sort_short", SHORT_LIST=f"{self.short_list}u"),
            _program("sort_long"),
            _program("cast", **weights, **cells, **self._casting()),
        )
        return {program.name: program for program in programs}

    def _casting(self) -> dict[str, object]:
        return {
            **kernel_constants(self.kernel),
            **_MOST,
            "LIST_LENGTH": self.list_length,
            "DEPTH_BACKGROUND": f"float({DEPTH_BACKGROUND!r})",
            "WITH_COLORS": int("color" in self.attributes),
            "WITH_VELOCITIES": int("velocity" in self.attributes),
            "WITH_BALLS": int("ball" in self.attributes),
        }


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    names: tuple[Attribute, ...] = ("color", "velocity", "ball")
    subsets = [frozenset(chosen) for count in range(4) for chosen in combinations(names, count)]
    for kernel, flag, attributes in product(KERNELS.values(), (False, True), subsets):
        yield from Variant(kernel, flag, attributes).programs().values()
    yield from Variant(KERNELS["wyvill"], short_list=SOFTWARE_SHORT_LIST).programs().values()


def _program(name: str, **constants: object) -> ProgramSource:
    return ProgramSource(name, compute=f"{FOLDER}/{name}.comp", constants=tuple(sorted(constants.items())))
