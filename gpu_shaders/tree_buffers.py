"""A tree over balls in the memory of the graphics processor, as lib/fitted_bvh.glsl reads it."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import numpy.typing as npt

from ..addon.fluid.balls import Balls
from ..addon.render.fitted_bvh import TreeArrays
from ..addon.render.method import Attribute
from .buffer_texture import BufferTexture, Texels
from .context import GpuContext
from .storage import Storage
from .tree_constants import TreeVariant

# Where each part is bound, and what its texels are.
_PARTS: dict[str, tuple[int, Texels]] = {
    "nodes": (0, "u4"),
    "balls": (1, "f4"),
    "weights": (2, "f1"),
    "ids": (3, "u1"),
    "colors": (4, "f1"),
    "velocities": (5, "f1"),
}

_GREATEST_WEIGHT = 1e15
"""Of a ball in radii, as for the native core: the squares of the density's slopes must be floats."""

_STORAGE_VERSION = 430
_STORAGE_BLOCKS = 10
"""Those of a tree, and what the shaders that use it may have beside it."""


def uses_storage(context: GpuContext) -> bool:
    """Whether storage buffers, and compute shaders that read them, are the faster way: not in software."""
    has_storage = context.version >= _STORAGE_VERSION and context.limits.storage_blocks >= _STORAGE_BLOCKS
    return has_storage and not context.is_software


class TreeBuffers:
    """A tree, and what its balls carry to the surface; made and used on the context's thread.

    Nothing is written where something lay before, so what is still drawn from an older tree is not waited for.

    Parameters
    ----------
    context
        Where it is to lie.
    tree, balls
        The tree, and the balls in it.
    attributes
        What is wanted of the balls.
    with_storage
        Whether to use storage buffers, else buffer textures. DeviceError where a part is too large for them.
    overlaps
        Whether the tree's nodes do.

    Attributes
    ----------
    variant
        What shaders must know of it.
    textures
        Its parts by sampler name; none where they are storage buffers.
    uniforms
        What else lib/fitted_bvh.glsl wants to know of the balls.
    """

    def __init__(
        self,
        context: GpuContext,
        tree: TreeArrays,
        balls: Balls,
        attributes: frozenset[Attribute],
        *,
        with_storage: bool,
        overlaps: bool = False,
    ) -> None:
        self.variant = TreeVariant(with_storage, balls.weight is None, overlaps)
        self.uniforms: dict[str, object] = {"weight_of_all": float(balls.weight or 0.0)}
        self.textures: dict[str, BufferTexture] = {}
        self._attributes = attributes
        self._buffers: dict[int, moderngl.Buffer] = {}
        storage = Storage(context)
        for name, array in _parts(tree, balls, attributes):
            binding, texels = _PARTS[name]
            if with_storage:
                self._buffers[binding] = storage.of(array)
            else:
                self.textures[f"{name}_tx"] = BufferTexture.of(context, texels, array)

    def has(self, attributes: frozenset[Attribute]) -> bool:
        """Whether what the attributes need is here."""
        return attributes <= self._attributes

    def bind(self) -> None:
        """Bind the storage buffers."""
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)


def _parts(
    tree: TreeArrays, balls: Balls, attributes: frozenset[Attribute]
) -> Iterator[tuple[str, npt.NDArray[np.float32] | npt.NDArray[np.uint32]]]:
    """The arrays by name. Each leaf has its balls one after the other, so that a ray reads them without a detour."""
    # Between leaves there are gaps, which nobody reads.
    ids = np.minimum(tree.ids, len(balls) - 1)
    yield "nodes", tree.nodes
    yield "balls", tree.balls[ids]
    if balls.weight is None:
        greatest = np.float32(_GREATEST_WEIGHT) * balls.radii
        yield "weights", np.clip(balls.weights, -greatest, greatest)[ids]
    if attributes:
        yield "ids", ids
    if "color" in attributes and balls.colors is not None:
        yield "colors", balls.colors
    if "velocity" in attributes and balls.velocities is not None:
        yield "velocities", balls.velocities
