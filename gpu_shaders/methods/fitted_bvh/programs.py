"""The programs of Fitted BVH, as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

from ....addon.fluid.kernels import POLYNOMIAL_KERNELS, PolynomialKernel
from ....addon.render.method import ATTRIBUTES, Attribute
from ...programs import ProgramSource, output_constants
from ...tree_constants import TreeVariant

FOLDER = "methods/fitted_bvh"


@dataclass(frozen=True)
class Variant:
    """What the program of a frame depends on.

    Attributes
    ----------
    kernel
        The density kernel.
    tree
        The kind of tree, and how it lies in memory.
    attributes
        What is found beside depth and normal, in the order of ATTRIBUTES.
    """

    kernel: PolynomialKernel
    tree: TreeVariant
    attributes: tuple[Attribute, ...] = ()

    def program(self) -> ProgramSource:
        """Casts the rays of the pixels: a compute shader where the tree lies in storage buffers."""
        constants = {**self.tree.constants(self.kernel), **output_constants(self.attributes)}
        if self.tree.with_storage:
            return ProgramSource("cast", compute=f"{FOLDER}/cast.comp", constants=tuple(sorted(constants.items())))
        return ProgramSource("cast", "lib/screen.vert", f"{FOLDER}/cast.frag", constants=tuple(sorted(constants.items())))


def all_programs() -> Iterator[ProgramSource]:
    """Every program with every combination of constants that it may be compiled with."""
    subsets = [chosen for count in range(4) for chosen in combinations(ATTRIBUTES, count)]
    for kernel, storage, weights, attributes in product(POLYNOMIAL_KERNELS.values(), (False, True), (False, True), subsets):
        yield Variant(kernel, TreeVariant(storage, weights), attributes).program()
    for storage, weights in product((False, True), repeat=2):
        yield Variant(POLYNOMIAL_KERNELS["wyvill"], TreeVariant(storage, weights, overlaps=True)).program()
