"""Shader nodes of materials and worlds, as far as they are the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from ..fluid.lighting import Vector

_CONSTANTS = {"RGB", "VALUE"}
"""Types of nodes that give one value everywhere."""


def output_source(owner: bpy.types.Material | bpy.types.World, name: str) -> bpy.types.Node | None:
    """The node that is linked to an input of the output of a material or a world; None where there is none, or no nodes."""
    # Since 5.0 there are nodes always, and to ask is deprecated.
    if owner.node_tree is None or (bpy.app.version < (5, 0) and not owner.use_nodes):
        return None
    output = owner.node_tree.get_output_node("ALL")
    source = None if output is None else source_of(output.inputs[name])
    return None if source is None else source.node


def source_of(entry: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The output of a node that is linked to an input; None where there is none."""
    links = entry.links
    while links and links[0].from_node.type == "REROUTE":
        links = links[0].from_node.inputs[0].links
    return links[0].from_socket if links else None


@dataclass
class NodeValues:
    """The inputs of a node.

    Attributes
    ----------
    node
        Whose inputs they are.
    unread
        Names of those that differ from place to place, for which the defaults were given.
    """

    node: bpy.types.Node
    unread: list[str] = field(default_factory=list)

    def number(self, name: str, default: float) -> float:
        """An input that is a number."""
        value = self._value(name)
        return default if value is None else float(value)

    def color(self, name: str, default: Vector) -> Vector:
        """An input that is a colour, linear Rec.709, or another vector."""
        value = self._value(name)
        return default if value is None else tuple(value[:3])

    def _value(self, name: str) -> object | None:
        entry = self.node.inputs[name]
        source = source_of(entry)
        if source is None:
            return entry.default_value
        if source.node.type in _CONSTANTS and source.type == entry.type:
            return source.default_value
        self.unread.append(name)
        return None


def scaled(color: Vector, factor: float) -> Vector:
    """A colour times a number."""
    return color[0] * factor, color[1] * factor, color[2] * factor
