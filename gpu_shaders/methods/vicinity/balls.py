"""Balls and their neighbours in the memory of the graphics processor."""

from __future__ import annotations

import numpy as np

from ....addon.fluid.balls import Balls
from ....addon.fluid.field import Field
from ....addon.render.method import Attribute
from ....addon.render.neighbours import Neighbours
from ...buffer_texture import BufferTexture
from ...context import GpuContext

_GREATEST_WEIGHT = 1e15
"""Of a ball in radii, as for the native core: the squares of the density's slopes must be floats."""


class BallTextures:
    """Balls in the order of space, with their lists; made and used on the context's thread.

    Parameters
    ----------
    context
        Where they are to lie; DeviceError where it takes no buffer textures so large.
    balls, neighbours
        The balls and their lists.
    field
        Decides how large kernel spheres are.
    attributes
        What is wanted of the balls.

    Attributes
    ----------
    textures
        By sampler name.
    uniforms
        What else the shaders want to know of the balls.
    lone
        How many balls have no neighbours.
    """

    def __init__(
        self, context: GpuContext, balls: Balls, neighbours: Neighbours, field: Field, attributes: frozenset[Attribute]
    ) -> None:
        self._context, self._balls, self._neighbours = context, balls, neighbours
        self._attributes: frozenset[Attribute] = frozenset()
        order = neighbours.order
        centers = (balls.positions[order] - neighbours.origin).astype(np.float32)
        self.textures: dict[str, BufferTexture] = {
            "balls_tx": BufferTexture.of(context, "f4", np.column_stack([centers, balls.radii[order]])),
            "starts_tx": BufferTexture.of(context, "u1", neighbours.starts),
            "neighbours_tx": BufferTexture.of(context, "u1", neighbours.places),
        }
        self.uniforms: dict[str, object] = {"weight_of_all": float(balls.weight or 0.0)}
        self.lone = int(np.count_nonzero(neighbours.counts == 0))
        if balls.weight is None:
            greatest = np.float32(_GREATEST_WEIGHT) * balls.radii
            weights = np.clip(balls.weights, -greatest, greatest)[order]
            self.textures["weights_tx"] = BufferTexture.of(context, "f1", weights)
        self.set_field(field)
        self.add(attributes)

    def set_field(self, field: Field) -> None:
        """Take the kernel spheres of a field."""
        radii = self._balls.radii[self._neighbours.order]
        kernel_radii = field.kernel_radii(radii, self._balls.weights[self._neighbours.order]).astype(np.float32)
        self.field = field
        self.textures["kernel_radii_tx"] = BufferTexture.of(self._context, "f1", kernel_radii)

    def add(self, attributes: frozenset[Attribute]) -> None:
        """Take what the attributes need, as far as it is not here."""
        missing = attributes - self._attributes
        if missing and not self._attributes:
            self.textures["order_tx"] = BufferTexture.of(self._context, "u1", self._neighbours.order)
        if "color" in missing and self._balls.colors is not None:
            self.textures["colors_tx"] = BufferTexture.of(self._context, "f1", self._balls.colors)
        if "velocity" in missing and self._balls.velocities is not None:
            self.textures["velocities_tx"] = BufferTexture.of(self._context, "f1", self._balls.velocities)
        self._attributes |= attributes
