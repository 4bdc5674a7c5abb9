"""What the peers inside Blender share. Uses bpy."""

from __future__ import annotations

import bpy
import numpy as np

from .peer import Mesh


def empty_scene() -> bpy.types.Scene:
    """The scene of a new file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def add_object(scene: bpy.types.Scene, data: bpy.types.ID) -> bpy.types.Object:
    """A new object in `scene` that shows `data`."""
    item = bpy.data.objects.new("Peer", data)
    scene.collection.objects.link(item)
    return item


def as_mesh(mesh: bpy.types.Mesh) -> Mesh:
    """The triangles of a mesh, with the normals that it is shaded with when smooth."""
    mesh.calc_loop_triangles()
    vertices = np.empty((len(mesh.vertices), 3), np.float32)
    normals = np.empty_like(vertices)
    triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
    mesh.vertices.foreach_get("co", vertices.reshape(-1))
    mesh.vertex_normals.foreach_get("vector", normals.reshape(-1))
    mesh.loop_triangles.foreach_get("vertices", triangles.reshape(-1))
    return Mesh(vertices, normals, triangles)


def mesh_of_triangles(vertices: np.ndarray, triangles: np.ndarray) -> bpy.types.Mesh:
    """A new mesh from (V, 3) vertices and (T, 3) triangles."""
    mesh = bpy.data.meshes.new("Triangles")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).reshape(-1))
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, np.int32).reshape(-1))
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh
