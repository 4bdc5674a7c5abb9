"""The programs of Tile Lists, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

from ....addon.fluid.kernels import POLYNOMIAL_KERNELS, PolynomialKernel
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.render.method import Attribute
from ...compute_step import MOST_GROUPS
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
"""PolynomialKernel spheres that groups of threads draw together; any more are drawn by single threads."""
THREADS = 128
"""Of a group of most steps."""
TEAM, SHORT_LIST = 16, 64
"""Threads that sort a short list, and how many entries it has at most."""
SOFTWARE_SHORT_LIST = 512
"""Those that one thread sorts in software, where waiting for one another costs more than is gained."""
LONG_THREADS, LONG_STAGES = 128, 10
"""Of a group that sorts a long list; two to the second power are the entries that it sorts in its own memory."""
LONGEST_THREADS, LONGEST_STAGES = 512, 12
"""The same for longer lists. OpenGL guarantees room for so many entries."""
TILE_SHIFTS = (1, 3, 6, 9)
"""Sides of the tiles of each level, powers of two, pixels."""
FINEST_SPAN = 8
"""Pixels across of the balls that are in tiles of the finest level."""
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
    is_software
        Whether OpenGL runs on the CPU.
    """

    kernel: PolynomialKernel
    with_weights: bool = False
    attributes: frozenset[Attribute] = frozenset()
    list_length: int = LIST_LENGTH
    is_software: bool = False

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        weights = {"WITH_WEIGHTS": int(self.with_weights)}
        cells = {"CELL_SIZE": CELL_SIZE, "OCCLUSION_LEVELS": OCCLUSION_LEVELS, "THREADS": THREADS}
        tiles = {"CELL_SHIFT": CELL_SIZE.bit_length() - 1, "FINEST_SPAN": FINEST_SPAN}
        short_list = SOFTWARE_SHORT_LIST if self.is_software else SHORT_LIST
        short = {"THREADS": THREADS, "SHORT_LIST": f"{short_list}u"}
        spheres = {**weights, **cells, "TIGHT_RECTANGLES": 1}
        drawing = {
            **spheres,
            "KERNEL_SHARES": KERNEL_SHARES,
            "LARGE_OCCLUDERS": LARGE_OCCLUDERS,
            "DISTANCE_ERROR": "1e-6",
        }
        allotting = {
            "MOST_GROUPS": MOST_GROUPS,
            "LONG_LIST": f"{1 << LONG_STAGES}u",
            "SUM_STEPS": f"{THREADS.bit_length() - 1}u",
        }
        programs = (
            _program("occlude", **drawing),
            _program("occlude_large", **drawing),
            _program("pyramid", **cells),
            _program("cull", **spheres, **tiles),
            _program("allot", **allotting, **short),
            _program("fill", **cells, **tiles),
            _program("sort_serial", **short) if self.is_software else _program("sort_short", TEAM=f"{TEAM}u", **short),
            _program("sort_long", SORT_THREADS=LONG_THREADS, BLOCK_STAGES=f"{LONG_STAGES}u"),
            _program("sort_longest", SORT_THREADS=LONGEST_THREADS, BLOCK_STAGES=f"{LONGEST_STAGES}u"),
            _program("cast", **weights, **cells, **tiles, **self._casting()),
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
    for kernel, flag, attributes in product(POLYNOMIAL_KERNELS.values(), (False, True), subsets):
        yield from Variant(kernel, flag, attributes).programs().values()

    yield from Variant(POLYNOMIAL_KERNELS["wyvill"], is_software=True).programs().values()


def _program(name: str, **constants: object) -> ProgramSource:
    return ProgramSource(name, compute=f"{FOLDER}/{name}.comp", constants=tuple(sorted(constants.items())))
