"""The meshes of a Blender scene that a render shows beside the fluid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.lighting import Material
from ..fluid.meshes import Meshes, MeshObject, MeshPart
from ..fluid.turning import turned
from .read_materials import read_material
from .read_particles import has_particle_systems
from .visible_sources import ShownTest, settings_of, shown_in_render, shown_in_viewport

_WITH_SURFACE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that have a surface, or can have a mesh made of it."""


def read_meshes(depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D | None = None) -> Meshes:
    """All surfaces of a view layer that are not fluid, at its current frame, instances too.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph. One that was made for the viewport holds only what the viewport evaluates.
    viewport
        The viewport whose visibility counts; None for that of renders.

    Raises
    ------
    InputError
        A render shows a surface that the viewport's dependency graph does not hold.
    """
    collected = _Collected(depsgraph.view_layer)
    if depsgraph.view_layer.use_solid:
        for instance in _shown_instances(depsgraph, viewport):
            collected.add(instance)
    return collected.meshes()


def _shown_instances(
    depsgraph: bpy.types.Depsgraph, viewport: bpy.types.SpaceView3D | None
) -> Iterator[bpy.types.DepsgraphObjectInstance]:
    """What there is to be seen; each is valid only until the next one is taken."""
    is_shown = _shown_in_render(depsgraph) if viewport is None else _shown_solid(depsgraph, viewport)
    for instance in depsgraph.object_instances:
        item = instance.instance_object if instance.is_instance else instance.object
        owner = instance.parent if instance.is_instance else item
        is_there = instance.show_self and is_shown(item, owner) and not _is_fluid(instance, item, depsgraph)
        if is_there and _is_for_cameras(item, owner.original, depsgraph.view_layer):
            yield instance


def _shown_in_render(depsgraph: bpy.types.Depsgraph) -> ShownTest:
    is_shown = shown_in_render(depsgraph, lambda item: _is_missed(item, depsgraph.view_layer))
    if depsgraph.mode == "RENDER":
        return is_shown
    return lambda item, owner: is_shown(item, owner) and _shows_itself_in_render(item)


def _is_for_cameras(item: bpy.types.Object, owner: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Whether rays from the camera see an object that `owner`, an original one, puts where it is."""
    return bool(item.visible_camera) and not owner.indirect_only_get(view_layer=view_layer)


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


def may_move(item: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Whether an object, or the surface that it has, may be elsewhere in other frames; as Cycles decides it.

    Parameters
    ----------
    item
        Evaluated.
    scene
        The original scene.
    """
    has_animation = item.animation_data or item.constraints or item.rigid_body or item.particle_systems
    if has_animation or getattr(item.data, "animation_data", None) or item.is_deform_modified(scene, "RENDER"):
        return True
    return item.parent is not None and may_move(item.parent, scene)


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


@dataclass
class _Collected:
    """Surfaces as they come; each mesh is read once, however often it is instanced."""

    view_layer: bpy.types.ViewLayer
    known: dict[int, _MeshArrays] = field(default_factory=dict)
    parts: list[tuple[_MeshArrays, npt.NDArray[np.int32], npt.NDArray[np.int32]]] = field(default_factory=list)
    names: list[MeshPart] = field(default_factory=list)
    objects: dict[MeshObject, int] = field(default_factory=dict)
    materials: dict[Material, int] = field(default_factory=dict)

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Take the surface of an instance, if it has one."""
        item = instance.object
        arrays = self._arrays(item)
        if arrays is None or not len(arrays.triangles):
            return
        owner = (instance.parent if instance.is_instance else item).original
        known = MeshObject(item.name, item.pass_index, item.is_holdout or owner.holdout_get(view_layer=self.view_layer))
        index = self.objects.setdefault(known, len(self.objects))
        slots = np.array([self._material(material) for material in self._materials_of(item)], np.int32)
        placed = _placed(arrays, np.array(instance.matrix_world, np.float64))
        materials = slots[np.clip(arrays.slots, 0, len(slots) - 1)]
        self.parts.append((placed, np.full(len(materials), index, np.int32), materials))
        key = item.name_full, owner.name_full, tuple(instance.persistent_id) if instance.is_instance else ()
        self.names.append(MeshPart(key, len(placed.vertices), len(placed.triangles)))

    def meshes(self) -> Meshes:
        """All together."""
        counts = [len(arrays.vertices) for arrays, _, _ in self.parts]
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int32) if counts else ()
        return Meshes(
            vertices=_joined([arrays.vertices for arrays, _, _ in self.parts], (0, 3), np.float32),
            triangles=_joined(
                [arrays.triangles + start for (arrays, _, _), start in zip(self.parts, starts, strict=True)], (0, 3), np.int32
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

    def _arrays(self, item: bpy.types.Object) -> _MeshArrays | None:
        # A mesh in edit mode seems empty, a copy does not.
        if isinstance(item.data, bpy.types.Mesh) and not item.data.is_editmode:
            key = item.data.as_pointer()
            if key not in self.known:
                self.known[key] = _read_mesh(item.data)
            return self.known[key]
        if item.type not in _WITH_SURFACE:
            return None
        try:
            mesh = item.to_mesh()
            return None if mesh is None else _read_mesh(mesh)
        finally:
            item.to_mesh_clear()


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
    vertices = turned(arrays.vertices, axes.astype(np.float32)) + world_from_object[:3, 3].astype(np.float32)
    return _MeshArrays(vertices, arrays.triangles, normals.reshape(-1, 3, 3), arrays.slots)


def _joined(parts: list[npt.NDArray], empty_shape: tuple[int, ...], dtype: type) -> npt.NDArray:
    return np.ascontiguousarray(np.concatenate(parts), dtype) if parts else np.empty(empty_shape, dtype)
