"""The programs of traced light, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from ...addon.fluid.kernels import POLYNOMIAL_KERNELS, PolynomialKernel
from ...addon.fluid.passes import DEPTH_BACKGROUND
from ..programs import ProgramSource
from ..tree_constants import TreeVariant

FOLDER = "tracing"
MATERIAL_TEXELS, LIGHT_TEXELS = 4, 5
"""Vectors of four numbers that describe a material and a light."""


@dataclass(frozen=True)
class Variant:
    """What the program depends on.

    Attributes
    ----------
    kernel
        The density kernel.
    tree
        The kind of tree, and how it lies in memory.
    with_colors, with_sources
        Whether balls have colours, and whether they differ in their materials.
    lets_pass
        Whether any material lets light pass.
    with_world_image
        Whether the world has an image.
    with_meshes
        Whether there are triangles.
    """

    kernel: PolynomialKernel
    tree: TreeVariant
    with_colors: bool = False
    with_sources: bool = False
    lets_pass: bool = False
    with_world_image: bool = False
    with_meshes: bool = False

    def program(self) -> ProgramSource:
        """A compute shader where the tree lies in storage buffers, else a fragment shader."""
        constants = {
            **self.tree.constants(self.kernel),
            "DEPTH_BACKGROUND": f"float({DEPTH_BACKGROUND!r})",
            "MATERIAL_TEXELS": MATERIAL_TEXELS,
            "LIGHT_TEXELS": LIGHT_TEXELS,
            "WITH_COLORS": int(self.with_colors),
            "WITH_VELOCITIES": 0,
            "WITH_BALLS": int(self.with_sources),
            "WITH_SOURCES": int(self.with_sources),
            "LETS_PASS": int(self.lets_pass),
            "WITH_WORLD_IMAGE": int(self.with_world_image),
            "WITH_MESHES": int(self.with_meshes),
        }
        named = tuple(sorted(constants.items()))
        if self.tree.with_storage:
            return ProgramSource("trace", compute=f"{FOLDER}/trace.comp", constants=named)
        return ProgramSource("trace", "lib/screen.vert", f"{FOLDER}/trace.frag", constants=named)


def all_programs() -> Iterator[ProgramSource]:
    """Every program under every constant that it may be compiled with, though not under all combinations of them."""
    for storage in (False, True):
        for kernel, weights in product(POLYNOMIAL_KERNELS.values(), (False, True)):
            yield Variant(kernel, TreeVariant(storage, weights)).program()
        for flags in product((False, True), repeat=5):
            yield Variant(POLYNOMIAL_KERNELS["wyvill"], TreeVariant(storage), *flags).program()
