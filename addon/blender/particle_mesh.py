"""Surface particles as the points of a mesh.

Up to 4.5 Python cannot fill point clouds; a mesh of vertices alone has the same attributes in every Blender.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..render.surface_particles import ParticleCloud

RADIUS_SHARE = 0.5
"""The attribute `radius` as a share of the distance to the neighbours: in an even spread the particles touch."""

_FLOAT, _VECTOR, _INTEGER = ("FLOAT", "value", np.float32), ("FLOAT_VECTOR", "vector", np.float32), ("INT", "value", np.int32)

ATTRIBUTES = {
    "position": _VECTOR,
    "surface_normal": _VECTOR,
    "velocity": _VECTOR,
    "radius": _FLOAT,
    "id": _INTEGER,
}
"""On points: type, and name and type of the value. Normals have a name of their own, because `normal` is what Blender makes of
faces."""


Columns = dict[str, npt.NDArray[Any]]
"""Values of all :data:`ATTRIBUTES` by name, (N, 3) or (N,)."""


def has_surface_particles(data: bpy.types.ID | None) -> bool:
    """Whether an object's own data, not what is evaluated of it, are the surface particles of a fluid."""
    return isinstance(data, bpy.types.Mesh) and data.meniscus.use_surface_particles


def columns_of(cloud: ParticleCloud) -> Columns:
    """The attributes of particles."""
    return {
        "position": cloud.positions,
        "surface_normal": cloud.normals,
        "velocity": cloud.velocities,
        "radius": np.float32(RADIUS_SHARE) * cloud.spacings,
        "id": cloud.ids.view(np.int32),
    }


def no_particles() -> Columns:
    """The attributes of none."""
    return {name: np.empty((0, 3) if value == "vector" else 0, dtype) for name, (_, value, dtype) in ATTRIBUTES.items()}


def put_particles(mesh: bpy.types.Mesh, columns: Columns) -> None:
    """Make particles the points of a mesh, in place of all that it has."""
    count = len(columns["id"])
    if len(mesh.vertices) != count or len(mesh.edges):
        mesh.clear_geometry()
        mesh.vertices.add(count)
    for name, values in columns.items():
        data_type, value, _ = ATTRIBUTES[name]
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, data_type, "POINT")
        attribute.data.foreach_set(value, values.ravel())
    mesh.update()
