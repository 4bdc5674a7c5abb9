"""What the images of a viewport show or mirror beside the fluid, read again only when something has changed."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ..fluid.lighting import Lighting
from ..fluid.meshes import Meshes
from ..render.backdrop import Surroundings
from .changes import Changes
from .engine_name import is_engine_view
from .read_meshes import read_meshes

_ARRAYS = ("vertices", "triangles", "normals", "object", "material")


@dataclass
class _Entry:
    read_at: int
    meshes: Meshes


class ViewSurroundings:
    """Meshes by scene, view layer and viewport.

    Parameters
    ----------
    changes
        Tells when to read again.
    """

    def __init__(self, changes: Changes) -> None:
        self._changes = changes
        self._entries: dict[tuple[int, str, int], _Entry] = {}

    def of(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, lighting: Lighting) -> Surroundings:
        """What traced light meets beside the fluid; it is seen itself where the render engine's viewport shows meshes."""
        scene, choice = context.scene, context.scene.meniscus.render_meshes
        is_rendered = is_engine_view(context)
        meshes = None if choice == "NONE" else self._meshes(depsgraph, context.space_data)
        if meshes is not None and not (is_rendered and choice == "SHADED"):
            meshes = meshes.unseen
        return Surroundings(meshes, lighting, is_film_clear=not is_rendered or scene.render.film_transparent)

    def forget(self) -> None:
        """Drop all, because the file is another."""
        self._entries.clear()

    def _meshes(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D) -> Meshes:
        key = depsgraph.scene.original.as_pointer(), depsgraph.view_layer.name, space.as_pointer()
        entry = self._entries.get(key)
        if entry is None or entry.read_at != self._changes.revision:
            meshes = read_meshes(depsgraph, viewport=space, is_traced=True)
            # What is the same keeps its trees.
            kept = entry.meshes if entry is not None and _is_same(meshes, entry.meshes) else meshes
            self._entries[key] = entry = _Entry(self._changes.revision, kept)
        return entry.meshes


def _is_same(meshes: Meshes, other: Meshes) -> bool:
    named = meshes.objects == other.objects and meshes.materials == other.materials
    return named and all(np.array_equal(getattr(meshes, name), getattr(other, name)) for name in _ARRAYS)
