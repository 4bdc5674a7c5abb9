"""The meshes of a Blender scene that a render shows beside the fluid."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.lighting import Material
from ..fluid.meshes import Meshes, MeshObject, MeshPart
from ..fluid.turning import turned
from .ball_part import FloatArray, transformed_points
from .moving import may_move
from .read_materials import read_material
from .read_particles import has_particle_systems
from .visible_sources import ShownTest, settings_of, shown_in_render, shown_in_viewport

Read = TypeVar("Read")

_WITH_SURFACE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that have a surface, or can have a mesh made of it."""


def read_meshes(
    depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D | None = None, is_traced: bool = False
) -> Meshes:
    """All surfaces of a view layer that are not fluid, at its current frame, instances too.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph. One that was made for the viewport holds only what the viewport evaluates.
    viewport
        The viewport whose visibility counts; None for that of renders.
    is_traced
        Whether light is traced, so that what no camera sees may be seen in mirrors and through what is clear.

    Raises
    ------
    InputError
        A render shows a surface that the viewport's dependency graph does not hold.
    """
    collected = _Collected(depsgraph.view_layer)
    if depsgraph.view_layer.use_solid:
        for instance in _shown_instances(depsgraph, viewport, is_traced):
            collected.add(instance)
    return collected.meshes()


def read_moved_vertices(depsgraph: bpy.types.Depsgraph, meshes: Meshes) -> FloatArray | None:
    """Where the vertices of meshes that were read in another frame are in the current one.

    Only what may move is read. What is not there, or has other numbers of vertices or triangles, stands still.

    Parameters
    ----------
    depsgraph
        The dependency graph that `meshes` were read from.

    Returns
    -------
    (V, 3) float32, world space; None where all are where they were.

    Raises
    ------
    InputError
        As for :func:`read_meshes`.
    """
    parts = {part.key: part for part in meshes.parts}
    positions = _EachOnce(_read_positions)
    vertices = meshes.vertices.copy()
    for instance in _shown_instances(depsgraph, None):  # what no camera sees has no motion
        part = parts.get(_key_of(instance))
        if part is None or not _may_have_moved(instance, part, depsgraph.scene):
            continue
        found, place = positions.of(instance.object), np.array(instance.matrix_world, np.float64)
        if found is not None and found.counts == (part.vertex_count, part.triangle_count):
            vertices[part.first_vertex :][: part.vertex_count] = transformed_points(found.vertices, place)
    return None if np.array_equal(vertices, meshes.vertices) else vertices


def _may_have_moved(instance: bpy.types.DepsgraphObjectInstance, part: MeshPart, scene: bpy.types.Scene) -> bool:
    is_elsewhere = not np.array_equal(np.array(instance.matrix_world, np.float64), part.world_from_object)
    return is_elsewhere or may_move(instance.object, scene)


def _key_of(instance: bpy.types.DepsgraphObjectInstance) -> Hashable:
    """What names an instance, or an object itself, in all frames."""
    if not instance.is_instance:
        return instance.object.name_full
    return instance.object.name_full, instance.parent.name_full, tuple(instance.persistent_id)


def _shown_instances(
    depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D | None, is_traced: bool = False
) -> Iterator[bpy.types.DepsgraphObjectInstance]:
    """What there is to be seen; each is valid only until the next one is taken."""
    is_shown = _shown_in_render(depsgraph) if viewport is None else _shown_solid(depsgraph, viewport)
    for instance in depsgraph.object_instances:
        item = instance.instance_object if instance.is_instance else instance.object
        owner = instance.parent if instance.is_instance else item
        is_there = instance.show_self and is_shown(item, owner) and not _is_fluid(instance, item, depsgraph)
        if is_there and (_is_for_cameras(item, owner.original, depsgraph.view_layer) or (is_traced and _is_for_rays(item))):
            yield instance


def _shown_in_render(depsgraph: bpy.types.Depsgraph) -> ShownTest:
    is_shown = shown_in_render(depsgraph, lambda item: _is_missed(item, depsgraph.view_layer))
    if depsgraph.mode == "RENDER":
        return is_shown
    return lambda item, owner: is_shown(item, owner) and _shows_itself_in_render(item)


def _is_for_cameras(item: bpy.types.Object, owner: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether rays from the camera see an object that `owner`, an original one, puts where it is."""
    return bool(item.visible_camera) and not owner.indirect_only_get(view_layer=view_layer)


def _is_for_rays(item: bpy.types.Object) -> bool:
    """Whether mirrored or refracted rays see an object."""
    return bool(item.visible_glossy or item.visible_transmission)


def _is_missed(item: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether something to be seen is lost with an original object that the viewport's dependency graph does not list."""
    if not _is_for_cameras(item, item, view_layer):
        return False
    if item.visible_get(view_layer=view_layer):  # instances may be listed without what makes them
        return item.type in _WITH_SURFACE and item.show_instancer_for_render
    return item.type in _WITH_SURFACE or item.instance_type != "NONE"


def _shows_itself_in_render(item: bpy.types.Object) -> bool:
    """Whether a render shows an object beside its instances, where a dependency graph of the viewport shows it."""
    if item.show_instancer_for_render or not item.show_instancer_for_viewport:
        return True
    may_make_instances = any(modifier.type == "NODES" for modifier in item.modifiers)
    return item.instance_type == "NONE" and not item.particle_systems and not may_make_instances


def _shown_solid(depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D) -> ShownTest:
    """Whether a viewport shows an object that a render shows too, and not as wires."""
    is_shown = shown_in_viewport(depsgraph, viewport)
    return lambda item, owner: is_shown(item, owner) and not item.hide_render and item.display_type in {"SOLID", "TEXTURED"}


def _is_fluid(instance: bpy.types.DepsgraphObjectInstance, item: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether fluid takes the place of a surface: points and domains do of their own, particles of what they instance."""
    if instance.particle_system is not None:
        return bool(settings_of(instance.parent, depsgraph).use_fluid)
    settings = settings_of(item, depsgraph)
    return bool(settings.use_fluid) and fluid_replaces_surface(item, settings)


def fluid_replaces_surface(item: bpy.types.Object, settings: bpy.types.PropertyGroup) -> bool:
    """Whether the fluid of a source, with the given ``meniscus`` properties, takes the place of its own surface."""
    is_domain = any(modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN" for modifier in item.modifiers)
    return is_domain or settings.source == "POINTS" or not has_particle_systems(item)


@dataclass(frozen=True)
class _MeshArrays:
    """A mesh in its own space: vertices (V, 3), triangles (T, 3), corner normals (T, 3, 3), material slots (T,)."""

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    normals: npt.NDArray[np.float32]
    slots: npt.NDArray[np.int32]


@dataclass(frozen=True)
class _Positions:
    """Where the vertices of a mesh are in its own space, (V, 3), and the numbers of vertices and triangles."""

    vertices: FloatArray
    counts: tuple[int, int]


@dataclass
class _EachOnce(Generic[Read]):
    """Reads the meshes of objects, each mesh once, however often it is instanced."""

    read: Callable[[bpy.types.Mesh], Read]
    known: dict[int, Read] = field(default_factory=dict)

    def of(self, item: bpy.types.Object) -> Read | None:
        """What an object's mesh is read as; None where it has no surface."""
        # A mesh in edit mode seems empty, a copy does not.
        if isinstance(item.data, bpy.types.Mesh) and not item.data.is_editmode:
            key = item.data.as_pointer()
            if key not in self.known:
                self.known[key] = self.read(item.data)
            return self.known[key]
        if item.type not in _WITH_SURFACE:
            return None
        try:
            mesh = item.to_mesh()
            return None if mesh is None else self.read(mesh)
        finally:
            item.to_mesh_clear()


@dataclass
class _Collected:
    """Surfaces as they come."""

    view_layer: bpy.types.ViewLayer
    arrays: _EachOnce[_MeshArrays] = field(default_factory=lambda: _EachOnce(_read_mesh))
    parts: list[tuple[_MeshArrays, npt.NDArray[np.int32], npt.NDArray[np.int32]]] = field(default_factory=list)
    names: list[MeshPart] = field(default_factory=list)
    vertex_count: int = 0
    objects: dict[MeshObject, int] = field(default_factory=dict)
    materials: dict[Material, int] = field(default_factory=dict)

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Take the surface of an instance, if it has one."""
        item = instance.object
        arrays = self.arrays.of(item)
        if arrays is None or not len(arrays.triangles):
            return
        owner = (instance.parent if instance.is_instance else item).original
        known = MeshObject(
            item.name,
            item.pass_index,
            item.is_holdout or owner.holdout_get(view_layer=self.view_layer),
            is_seen=_is_for_cameras(item, owner, self.view_layer),
            is_traced=_is_for_rays(item),
        )
        index = self.objects.setdefault(known, len(self.objects))
        slots = np.array([self._material(material) for material in self._materials_of(item)], np.int32)
        place = np.array(instance.matrix_world, np.float64)
        placed = _placed(arrays, place)
        materials = slots[np.clip(arrays.slots, 0, len(slots) - 1)]
        self.parts.append((placed, np.full(len(materials), index, np.int32), materials))
        counts = len(placed.vertices), len(placed.triangles)
        self.names.append(MeshPart(_key_of(instance), self.vertex_count, *counts, place))
        self.vertex_count += counts[0]

    def meshes(self) -> Meshes:
        """All together."""
        return Meshes(
            vertices=_joined([arrays.vertices for arrays, _, _ in self.parts], (0, 3), np.float32),
            triangles=_joined(
                [
                    arrays.triangles + np.int32(part.first_vertex)
                    for (arrays, _, _), part in zip(self.parts, self.names, strict=True)
                ],
                (0, 3),
                np.int32,
            ),
            normals=_joined([arrays.normals for arrays, _, _ in self.parts], (0, 3, 3), np.float32),
            object=_joined([objects for _, objects, _ in self.parts], (0,), np.int32),
            material=_joined([materials for _, _, materials in self.parts], (0,), np.int32),
            objects=tuple(self.objects),
            materials=tuple(self.materials),
            parts=tuple(self.names),
        )

    def _materials_of(self, item: bpy.types.Object) -> list[bpy.types.Material | None]:
        if self.view_layer.material_override is not None:
            return [self.view_layer.material_override]
        return [slot.material for slot in item.material_slots] or [None]

    def _material(self, material: bpy.types.Material | None) -> int:
        return self.materials.setdefault(read_material(material), len(self.materials))


def _read_mesh(mesh: bpy.types.Mesh) -> _MeshArrays:
    """The arrays of a mesh, from its attributes where there are some: other properties take a hundred times as long."""
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):
        empty = np.empty((0, 3), np.float32)
        return _MeshArrays(empty, empty.astype(np.int32), empty.reshape(0, 3, 3), np.empty(0, np.int32))
    corners = _triangle_corners(mesh)
    vertices = _values(mesh.attributes["position"].data, "vector", (len(mesh.vertices), 3), np.float32)
    vertex_of_corner = _values(mesh.attributes[".corner_vert"].data, "value", (len(mesh.loops),), np.int32)
    normals = _values(mesh.corner_normals, "vector", (len(mesh.loops), 3), np.float32)
    return _MeshArrays(vertices, vertex_of_corner[corners], normals[corners], _triangle_slots(mesh))


def _read_positions(mesh: bpy.types.Mesh) -> _Positions:
    if not len(mesh.vertices):  # it may have no attributes
        return _Positions(np.empty((0, 3), np.float32), (0, 0))
    vertices = _values(mesh.attributes["position"].data, "vector", (len(mesh.vertices), 3), np.float32)
    # A face of n corners makes n - 2 triangles.
    return _Positions(vertices, (len(vertices), len(mesh.loops) - 2 * len(mesh.polygons)))


def _triangle_corners(mesh: bpy.types.Mesh) -> npt.NDArray[np.int32]:
    """(T, 3): which corners of its faces the triangles of a mesh have."""
    count = len(mesh.loop_triangles)
    if len(mesh.loops) == 3 * count:  # all faces are triangles
        return np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return _values(mesh.loop_triangles, "loops", (count, 3), np.int32)


def _triangle_slots(mesh: bpy.types.Mesh) -> npt.NDArray[np.int32]:
    """(T,): the material slots of a mesh's triangles."""
    count, slots = len(mesh.loop_triangles), mesh.attributes.get("material_index")
    if slots is None:
        return np.zeros(count, np.int32)
    faces = _values(mesh.loop_triangle_polygons, "value", (count,), np.int32)
    return _values(slots.data, "value", (len(mesh.polygons),), np.int32)[faces]


def _values(
    collection: bpy.types.bpy_prop_collection, name: str, shape: tuple[int, ...], dtype: type
) -> npt.NDArray[np.float32] | npt.NDArray[np.int32]:
    values = np.empty(shape, dtype)
    collection.foreach_get(name, values.reshape(-1))
    return values


def _placed(arrays: _MeshArrays, world_from_object: npt.NDArray[np.float64]) -> _MeshArrays:
    """A mesh in world space."""
    axes = world_from_object[:3, :3].T
    # Cofactors turn normals as the inverse transposed does, and exist for flat transforms too; mirrored ones turn them around.
    cofactors = np.cross(axes[[1, 2, 0]], axes[[2, 0, 1]])
    cofactors /= np.abs(cofactors).max() or 1.0
    normals = turned(arrays.normals.reshape(-1, 3), cofactors.astype(np.float32))
    normals /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normals, normals)), np.float32(1e-30))[:, None]
    vertices = transformed_points(arrays.vertices, world_from_object)
    return _MeshArrays(vertices, arrays.triangles, normals.reshape(-1, 3, 3), arrays.slots)


def _joined(parts: list[npt.NDArray], empty_shape: tuple[int, ...], dtype: type) -> npt.NDArray:
    return np.ascontiguousarray(np.concatenate(parts), dtype) if parts else np.empty(empty_shape, dtype)
