"""The programs of Depth Peeling, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from itertools import product

from ....addon.fluid.kernels import POLYNOMIAL_KERNELS, PolynomialKernel
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ...ball_textures import BALL_TEXTURE_WIDTH
from ...image_cells import CELL_FACTOR, CELL_SIZE
from ...kernel_constants import kernel_constants
from ...programs import ProgramSource
from .options import Options

FOLDER = "methods/depth_peeling"
LIST_TARGETS = 4
"""N_buf render targets of four words hold the state, which takes two, and 4 N_buf - 2 = 14 ids, as in the paper."""
LIST_LENGTH = 4 * LIST_TARGETS - 2
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

    kernel: PolynomialKernel
    options: Options = Options()
    list_length: int = LIST_LENGTH
    with_colors: bool = False
    with_starts: bool = False

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        sources = [*self._on_all_balls(), *self._on_pairs(), *self._on_points(), *self._on_pixels()]
        return {source.name: source for source in sources}

    def _on_all_balls(self) -> Iterator[ProgramSource]:
        """Draw each ball's rectangle."""
        constants = {**self._balls(), "FROM_PAIRS": 0}
        yield _program("kernel", "sphere", "kernel_sphere", **constants, KERNEL_SPHERES=1, STARTS_ONLY=0)
        if self.with_starts:
            kernel = kernel_constants(self.kernel)
            yield _program("start", "sphere", "start", **constants, **kernel, KERNEL_SPHERES=0, STARTS_ONLY=1)

    def _on_pairs(self) -> Iterator[ProgramSource]:
        """Draw each ball's rectangle by cells."""
        constants = {**self._balls(), **self._cells(), "FROM_PAIRS": 1, "KERNEL_SPHERES": 0, "STARTS_ONLY": 0}
        kernel = kernel_constants(self.kernel)
        yield _program("peel", "sphere", "peel", **constants)
        yield _program("walk_sum", "sphere", "walk_sum", **constants, **kernel)
        yield _program("gather", "sphere", "gather", **constants, **kernel, WITH_COLORS=int(self.with_colors))

    def _on_points(self) -> Iterator[ProgramSource]:
        """Make pairs, and choose among them."""
        constants = {**self._balls(), **self._cells()}
        yield _captured("bin", "bin", **constants, TILING=int(self.options.tiling))
        for phase in Phase:
            yield _captured(f"keep_{phase.name.lower()}", "keep", **constants, CELL_PHASE=int(phase))
        yield _program("group", "group", "group")

    def _on_pixels(self) -> Iterator[ProgramSource]:
        """Draw the image, or its unfinished cells."""
        cells, options = self._cells(), self.options
        begin = {"KERNEL_SPHERES": int(options.kernel_spheres), "WITH_STARTS": int(self.with_starts)}
        yield _program("begin", "screen", "begin", **begin)
        yield _program("enter", "screen", "enter")
        yield _program("search", "tile", "search", **cells, **self._search())
        yield _program("count_walkers", "screen", "count_walkers")
        yield _program("begin_walk", "screen", "begin_walk")
        yield _program("walk_step", "tile", "walk_step", **cells)
        yield _program("finish", "screen", "finish", DEPTH_BACKGROUND=f"float({DEPTH_BACKGROUND!r})")
        for phase in Phase:
            constants = {"CELL_SIZE": CELL_SIZE, "CELL_PHASE": int(phase)}
            yield _program(f"cells_from_pixels_{phase.name.lower()}", "screen", "cells_from_pixels", **constants)
        yield ProgramSource("cells_from_cells", "lib/screen.vert", "lib/cells_from_cells.frag")

    def _balls(self) -> dict[str, object]:
        return {"BALL_TEXTURE_WIDTH": BALL_TEXTURE_WIDTH, "TIGHT_RECTANGLES": int(self.options.tight_rectangles)}

    def _cells(self) -> dict[str, object]:
        return {"CELL_SIZE": CELL_SIZE, "CELL_FACTOR": CELL_FACTOR, "BALL_CULLING": int(self.options.ball_culling)}

    def _search(self) -> dict[str, object]:
        return {
            **kernel_constants(self.kernel),
            "BALL_TEXTURE_WIDTH": BALL_TEXTURE_WIDTH,
            "LIST_LENGTH": self.list_length,
            "BEZIER_STACK": BEZIER_STACK if self.options.short_stack else 0,
            "DIAGNOSTICS": int(self.options.diagnostics),
        }


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    switches = [name for name in Options.__dataclass_fields__ if name != "diagnostics"]
    options = [Options(), Options(diagnostics=True), *(Options(**{name: False}) for name in switches)]
    for kernel, option, flag in product(POLYNOMIAL_KERNELS.values(), options, (False, True)):
        yield from Variant(kernel, option, with_colors=flag, with_starts=flag).programs().values()


def _program(name: str, vertex: str, fragment: str, **constants: object) -> ProgramSource:
    vertex_folder = "lib" if vertex == "screen" else FOLDER
    fragment_folder = "lib" if fragment == "kernel_sphere" else FOLDER
    files = f"{vertex_folder}/{vertex}.vert", f"{fragment_folder}/{fragment}.frag"
    return ProgramSource(name, *files, constants=tuple(sorted(constants.items())))


def _captured(name: str, stem: str, **constants: object) -> ProgramSource:
    """A program that emits pairs, for transform feedback."""
    files = {"vertex": f"{FOLDER}/{stem}.vert", "geometry": f"{FOLDER}/{stem}.geom"}
    return ProgramSource(name, **files, constants=tuple(sorted(constants.items())), varyings=("out_pair",))
