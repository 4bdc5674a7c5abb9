"""What all sample scenes are made of: boxes, points, surfaces, cameras and lights. Uses bpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import register
from ..addon.fluid.balls import Balls
from ..addon.fluid.errors import OutputError
from .one_thread import bpy

# Loaded after bpy, which they are parts of.
import bmesh  # isort: skip
from mathutils import Vector  # isort: skip

Point = tuple[float, float, float]

_BOX_FACES = {
    "bottom": (0, 3, 2, 1),
    "top": (4, 5, 6, 7),
    "front": (0, 1, 5, 4),
    "right": (1, 2, 6, 5),
    "back": (2, 3, 7, 6),
    "left": (3, 0, 4, 7),
}

_ATTRIBUTE_TYPES = {
    (np.dtype(np.float32), 1): ("FLOAT", "value"),
    (np.dtype(np.int32), 1): ("INT", "value"),
    (np.dtype(np.float32), 2): ("FLOAT_VECTOR", "vector"),
}


def new_scene() -> bpy.types.Scene:
    """An empty file's scene, with this package registered so that objects can be marked as fluids."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    if not hasattr(bpy.types.Object, "meniscus"):
        register()
    return bpy.context.scene


def save_blend(path: Path) -> None:
    """Save the open file, with the simulations that were baked in it; OutputError says why it cannot be saved."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, check_existing=False)
    except RuntimeError as error:
        raise OutputError(f"Cannot save {path}: {str(error).strip()}") from error


def add_mesh(scene: bpy.types.Scene, name: str, mesh: bpy.types.Mesh) -> bpy.types.Object:
    """A new object that shows `mesh` in `scene`."""
    item = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(item)
    return item


def add_box(scene: bpy.types.Scene, name: str, low: Point, high: Point, without: tuple[str, ...] = ()) -> bpy.types.Object:
    """An axis-aligned box between two corners, faces named in `without` (bottom, top, front, back, left, right) left out."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    points = [(x, y, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], [corners for side, corners in _BOX_FACES.items() if side not in without])
    return add_mesh(scene, name, mesh)


def add_turned(
    scene: bpy.types.Scene, name: str, profile: Sequence[tuple[float, float]], segments: int = 32
) -> bpy.types.Object:
    """A body of revolution around the z axis, from a profile of (radius, height), Blender units."""
    angles = np.arange(segments) * (2 * np.pi / segments)
    rings = np.array(
        [(radius * np.cos(angles), radius * np.sin(angles), np.full(segments, height)) for radius, height in profile]
    )
    here = np.arange(len(profile) - 1)[:, None] * segments + np.arange(segments)
    beside = np.arange(len(profile) - 1)[:, None] * segments + (np.arange(segments) + 1) % segments
    faces = np.stack([here, here + segments, beside + segments, beside], axis=-1).reshape(-1, 4)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(rings.transpose(0, 2, 1).reshape(-1, 3).tolist(), [], faces.tolist())
    _merge_coincident_points(mesh)
    return add_mesh(scene, name, mesh)


def _merge_coincident_points(mesh: bpy.types.Mesh) -> None:
    """Join the points on the axis, where faces without area would confuse the collision."""
    editable = bmesh.new()
    editable.from_mesh(mesh)
    bmesh.ops.remove_doubles(editable, verts=editable.verts, dist=1e-6)
    editable.to_mesh(mesh)
    editable.free()


def add_points(
    scene: bpy.types.Scene, name: str, positions: npt.NDArray[np.float32], attributes: Mapping[str, npt.NDArray[Any]]
) -> bpy.types.Object:
    """An object whose mesh is loose vertices.

    Parameters
    ----------
    positions
        (N, 3) float32, object space, Blender units.
    attributes
        By name: (N,) float32 or int32, or (N, 3) float32 values on the vertices.
    """
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.attributes["position"].data.foreach_set("vector", positions.ravel())
    for attribute_name, values in attributes.items():
        data_type, value_name = _ATTRIBUTE_TYPES[values.dtype, values.ndim]
        attribute = mesh.attributes.new(attribute_name, data_type, "POINT")
        attribute.data.foreach_set(value_name, values.ravel())
    mesh.update()
    return add_mesh(scene, name, mesh)


def add_balls(scene: bpy.types.Scene, name: str, balls: Balls) -> bpy.types.Object:
    """An object whose vertices are `balls`, with the attributes radius (the influence radius), velocity, id and color where
    known.
    """
    attributes = {"radius": balls.radii, "velocity": balls.velocities, "id": balls.ids, "color": balls.colors}
    known = {attribute: values for attribute, values in attributes.items() if values is not None}
    item = add_points(scene, name, balls.positions, known)
    use_as_fluid(item, source="POINTS", radius_mode="ATTRIBUTE", radius_attribute="radius")
    if balls.colors is not None:
        use_as_fluid(item, color_mode="ATTRIBUTE", color_attribute="color")
    return item


def use_as_fluid(item: bpy.types.Object, **settings: Any) -> None:
    """Mark `item` as a fluid with the given settings of ``object.meniscus``, where this package is registered."""
    if not hasattr(bpy.types.Object, "meniscus"):
        return
    item.meniscus.use_fluid = True
    for name, value in settings.items():
        setattr(item.meniscus, name, value)


def use_field(scene: bpy.types.Scene, **settings: Any) -> None:
    """Give `scene` the density field with the given settings of ``scene.meniscus``, where this package is registered."""
    if not hasattr(bpy.types.Scene, "meniscus"):
        return
    for name, value in settings.items():
        setattr(scene.meniscus, name, value)


def add_camera(scene: bpy.types.Scene, eye: Point, target: Point, lens: float = 50.0) -> bpy.types.Object:
    """The scene's camera at `eye`, looking at `target`; `lens` is the focal length in millimetres."""
    item = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    item.data.lens = lens
    item.location = eye
    item.rotation_euler = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(item)
    scene.camera = item
    return item


def add_lights(scene: bpy.types.Scene) -> None:
    """A sun from the upper left and a light grey world, so that the scene also renders in Cycles and EEVEE."""
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy = 3.0
    sun.rotation_euler = (0.8, -0.3, 0.4)
    scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("World")
    world.color = (0.6, 0.65, 0.7)
    scene.world = world


def add_surface(item: bpy.types.Object, color: tuple[float, float, float]) -> None:
    """Give `item` a plain material in `color`, linear Rec.709."""
    material = bpy.data.materials.new(item.name)
    material.diffuse_color = (*color, 1.0)
    item.data.materials.append(material)


def set_frames(scene: bpy.types.Scene, frame_end: int) -> None:
    """Frames 1 to `frame_end` at 25 a second, an image of 1280 x 720."""
    scene.frame_start, scene.frame_end = 1, frame_end
    scene.render.fps, scene.render.fps_base = 25, 1.0
    scene.render.resolution_x, scene.render.resolution_y = 1280, 720
    scene.render.resolution_percentage = 100
