"""The child process that casts rays at a peer's mesh, with Blender's tree of triangles."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from bench.worker import Message, serve

from . import blender


def cast(request: Message) -> Message:
    """Load a mesh and cast rays at it.

    The request names three .npz files: `mesh` as `bench.peers.worker` saves it; `rays` with origins and unit directions
    (count, 3), and the `reach`, as far as they go, which must be finite (Blender's tree takes infinity for a hit); `hits`,
    which is written: t (count,), infinite where there is no hit, and the interpolated normals (count, 3).
    """
    with np.load(request["mesh"]) as mesh, np.load(request["rays"]) as rays:
        vertices, normals, triangles = mesh["vertices"], mesh["normals"], mesh["triangles"]
        t, hit_triangles = _first_hits(vertices, triangles, rays["origins"], rays["directions"], float(rays["reach"]))
        points = rays["origins"] + np.where(np.isfinite(t), t, 0.0)[:, None] * rays["directions"]
    corners = triangles[hit_triangles]
    shares = _barycentric(vertices[corners].astype(np.float64), points)
    normal = np.einsum("rc,rcx->rx", shares, normals[corners].astype(np.float64))
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    np.savez(request["hits"], t=t, normals=normal / np.where(length > 0, length, 1.0))
    return {}


def _first_hits(
    vertices: np.ndarray, triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distances, infinite where there is no hit, and the triangles, 0 there."""
    blender.empty_scene()
    blender.add_object(bpy.context.scene, blender.mesh_of_triangles(vertices, triangles))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    tree = BVHTree.FromObject(bpy.context.scene.objects[0], depsgraph)
    t = np.full(len(origins), np.inf)
    hit_triangles = np.zeros(len(origins), np.int64)
    for ray, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
        _, _, triangle, distance = tree.ray_cast(origin, direction, reach)
        if triangle is not None:
            t[ray], hit_triangles[ray] = distance, triangle
    return t, hit_triangles


def _barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Shares (count, 3) of the corners (count, 3, 3) in points of their triangles; of the first alone in one without area."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    to_point = points - corners[:, 0]
    normal = np.cross(first, second)
    area = np.maximum(np.einsum("ij,ij->i", normal, normal), np.finfo(float).tiny)
    of_second = np.einsum("ij,ij->i", np.cross(to_point, second), normal) / area
    of_third = np.einsum("ij,ij->i", np.cross(first, to_point), normal) / area
    return np.stack([1 - of_second - of_third, of_second, of_third], axis=1)


if __name__ == "__main__":
    serve(cast)
