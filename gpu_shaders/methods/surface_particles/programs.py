"""The programs of Surface Particles, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ....addon.fluid.kernels import KERNELS, Kernel
from ...kernel_constants import kernel_constants
from ...programs import ROW_TEXTURE_WIDTH, ProgramSource

FOLDER = "methods/surface_particles"

THREADS = 64
"""Of a group that works on the grid."""

# Loops end by what they do; these numbers only keep a faulty driver from looping for ever.
_MOST: dict[str, object] = {"MOST_ENTRIES": "0x1000000u", "MOST_LEVELS": "256", "MOST_MEMBERS": "0x1000000u"}

_COMMON: dict[str, object] = {"ROW_TEXTURE_WIDTH": ROW_TEXTURE_WIDTH, **_MOST}


@dataclass(frozen=True)
class MotionPrograms:
    """What moves particles on a fluid of one density kernel."""

    kernel: Kernel

    def programs(self) -> dict[str, ProgramSource]:
        """The programs by name."""
        kernel = kernel_constants(self.kernel)
        return {name: _over_particles(name, **kernel) for name in ("flow", "settle", "spread")}


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
    for kernel in KERNELS.values():
        yield from MotionPrograms(kernel).programs().values()


def _over_particles(name: str, **constants: object) -> ProgramSource:
    """A fragment for each particle."""
    return _program(name, vertex="lib/screen.vert", **constants)


def _program(name: str, vertex: str, **constants: object) -> ProgramSource:
    return ProgramSource(name, vertex, f"{FOLDER}/{name}.frag", constants=_sorted(**constants))


def _sorted(**constants: object) -> tuple[tuple[str, object], ...]:
    return tuple(sorted({**_COMMON, **constants}.items()))
