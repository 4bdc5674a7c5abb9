"""Geometry Nodes: Points to Volume, then Volume to Mesh, as most Blender users mesh particles today."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from .peer import Case, Mesh, Stopwatch, Task

if TYPE_CHECKING:
    import bpy

CASES = (
    Case(
        "points_to_volume",
        "Points to Volume, Volume to Mesh, R/4",
        "poly6",
        0.2,
        "spheres",
        "mesh",
        "a union of the kernel spheres, which does not blend; judged by that union",
        {"voxel": 1 / 4},
    ),
)


class PointsToVolume:
    """A mesh of loose vertices with the two nodes as its modifier."""

    def __init__(self, task: Task) -> None:
        # Imported here because the cases are read where there is no Blender.
        import bpy

        from . import blender

        self._positions = task.positions
        scene = blender.empty_scene()
        self._points = bpy.data.meshes.new("Peer")
        self._points.vertices.add(len(task.positions))
        self._object = blender.add_object(scene, self._points)
        nodes = _new_nodes(bpy.data.node_groups.new("Peer", "GeometryNodeTree"), task)
        self._object.modifiers.new("Peer", "NODES").node_group = nodes
        self._depsgraph = bpy.context.evaluated_depsgraph_get()
        self._as_mesh = blender.as_mesh

    def surface(self) -> dict[str, float]:
        watch = Stopwatch()
        with watch.stage("hand over"):
            self._points.attributes["position"].data.foreach_set("vector", self._positions.reshape(-1))
        self._points.update_tag()
        with watch.stage("surface"):
            self._depsgraph.update()
        return watch.milliseconds

    def mesh(self) -> Mesh:
        return self._as_mesh(self._object.evaluated_get(self._depsgraph).data)


def _new_nodes(tree: bpy.types.NodeTree, task: Task) -> bpy.types.NodeTree:
    """The chain of nodes; what is not set here is as Blender sets it."""
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    names = (
        "NodeGroupInput",
        "GeometryNodeMeshToPoints",
        "GeometryNodePointsToVolume",
        "GeometryNodeVolumeToMesh",
        "NodeGroupOutput",
    )
    chain = [tree.nodes.new(name) for name in names]
    for source, target in pairwise(chain):
        tree.links.new(source.outputs[0], target.inputs[0])
    to_volume = chain[2].inputs
    to_volume["Resolution Mode"].default_value = "Size"
    to_volume["Voxel Size"].default_value = task.options["voxel"]
    to_volume["Radius"].default_value = task.kernel_radius
    return tree


create = PointsToVolume
