"""The programs of Depth Peeling, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

from ....addon.fluid.kernels import KERNELS, Kernel
from ...programs import ProgramSource
from .options import Options

FOLDER = "methods/depth_peeling"
BALL_TEXTURE_WIDTH = 4096
LIST_TARGETS = 4
"""N_buf render targets of four words hold the state, which takes two, and 4 N_buf - 2 = 14 ids, as in the paper."""
LIST_LENGTH = 4 * LIST_TARGETS - 2
CELL_SIZE = 8
"""Side of the smallest cells, pixels."""
CELL_FACTOR = 4
"""Cells along the side of one of the next level."""
BEZIER_STACK = 3


class Phase(IntEnum):
    """What a ray is doing; the numbers are those of state.glsl."""

    PEELING = 0
    WALKING = 1
    DONE = 2


@dataclass(frozen=True)
class Variant:
    """What the programs of a frame depend on.

    Attributes
    ----------
    kernel, options
        The density kernel and the optimisations.
    list_length
        Balls that a ray may be in before it walks, 1 to LIST_LENGTH.
    with_colors
        Whether the balls have colours that are wanted.
    with_starts
        Whether a ray may start inside the fluid or a ball has a negative weight.
    """

    kernel: Kernel
    options: Options = Options()
    list_length: int = LIST_LENGTH
    with_colors: bool = False
    with_starts: bool = False

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        options = self.options
        kernel = kernel_constants(self.kernel)
        balls = {"BALL_TEXTURE_WIDTH": BALL_TEXTURE_WIDTH, "TIGHT_RECTANGLES": int(options.tight_rectangles)}
        cells = {"CELL_SIZE": CELL_SIZE, "CELL_FACTOR": CELL_FACTOR, "BALL_CULLING": int(options.ball_culling)}
        pairs = {**balls, **cells, "FROM_PAIRS": 1, "KERNEL_SPHERES": 0, "STARTS_ONLY": 0}
        all_balls = {**balls, "FROM_PAIRS": 0, "KERNEL_SPHERES": 0, "STARTS_ONLY": 0}
        begin = {"KERNEL_SPHERES": int(options.kernel_spheres), "WITH_STARTS": int(self.with_starts)}
        stack = BEZIER_STACK if options.short_stack else 0
        search = {
            **kernel,
            "LIST_LENGTH": self.list_length,
            "BEZIER_STACK": stack,
            "DIAGNOSTICS": int(options.diagnostics),
        }
        sources = [
            _program("kernel", "sphere", "kernel", **{**all_balls, "KERNEL_SPHERES": 1}),
            _program("begin", "screen", "begin", **begin),
            _program("group", "group", "group"),
            _captured("bin", **balls, **cells, TILING=int(options.tiling)),
            _program("peel", "sphere", "peel", **pairs),
            _program("search", "tile", "search", **balls, **cells, **search),
            _program("count_walkers", "screen", "count_walkers"),
            _program("begin_walk", "screen", "begin_walk"),
            _program("walk_sum", "sphere", "walk_sum", **pairs, **kernel),
            _program("walk_step", "tile", "walk_step", **cells),
            _program("gather", "sphere", "gather", **pairs, **kernel, WITH_COLORS=int(self.with_colors)),
            _program("finish", "screen", "finish"),
            _program("cells_from_cells", "screen", "cells_from_cells"),
        ]
        if self.with_starts:
            sources.append(_program("start", "sphere", "start", **{**all_balls, "STARTS_ONLY": 1}, **kernel))
        for phase in Phase:
            name = f"cells_from_pixels_{phase.name.lower()}"
            sources.append(
                replace(_program("", "screen", "cells_from_pixels", CELL_SIZE=CELL_SIZE, CELL_PHASE=int(phase)), name=name)
            )
            sources.append(
                replace(_captured("keep", **balls, **cells, CELL_PHASE=int(phase)), name=f"keep_{phase.name.lower()}")
            )
        return {source.name: source for source in sources}


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    switches = [name for name in Options.__dataclass_fields__ if name != "diagnostics"]
    options = [Options(), Options(diagnostics=True), *(Options(**{name: False}) for name in switches)]
    for kernel, option, flag in product(KERNELS.values(), options, (False, True)):
        yield from Variant(kernel, option, with_colors=flag, with_starts=flag).programs().values()


def kernel_constants(kernel: Kernel) -> dict[str, object]:
    """The kernel as lib/kernel.glsl wants it: ``x^power (low + high x)``."""
    power = {1: 1, 2: 2, 3: 2, 4: 4}[len(kernel.coefficients) - 1]
    low, high = (*kernel.coefficients, 0.0)[power : power + 2]
    return {
        "KERNEL_DEGREE": kernel.ray_degree,
        "KERNEL_POWER": power,
        "KERNEL_LOW": f"float({low!r})",
        "KERNEL_HIGH": f"float({high!r})",
    }


def _program(name: str, vertex: str, fragment: str, **constants: object) -> ProgramSource:
    return ProgramSource(
        name, f"{FOLDER}/{vertex}.vert", f"{FOLDER}/{fragment}.frag", constants=tuple(sorted(constants.items()))
    )


def _captured(name: str, **constants: object) -> ProgramSource:
    """A program that emits pairs, for transform feedback."""
    return ProgramSource(
        name,
        f"{FOLDER}/{name}.vert",
        geometry=f"{FOLDER}/{name}.geom",
        constants=tuple(sorted(constants.items())),
        varyings=("out_pair",),
    )
