"""Blender's metaball object: the same field as Meniscus', polygonized on a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .peer import Case, Mesh, Stopwatch, Task

if TYPE_CHECKING:
    import bpy

_REMARK = "the same field: stiffness 1, threshold T"

CASES = tuple(
    Case("metaballs", f"Metaball object, R/{parts}", "poly6", 0.2, "field", "mesh", _REMARK, {"resolution": 1 / parts})
    for parts in (4, 2)
)


class Metaballs:
    """A metaball object with one element a ball."""

    def __init__(self, task: Task) -> None:
        # Imported here because the cases are read where there is no Blender.
        import bpy

        from . import blender

        self._positions = task.positions
        scene = blender.empty_scene()
        self._family = _new_family(bpy.data.metaballs.new("Peer"), task)
        self._object = blender.add_object(scene, self._family)
        self._depsgraph = bpy.context.evaluated_depsgraph_get()
        self._as_mesh = blender.as_mesh

    def surface(self) -> dict[str, float]:
        watch = Stopwatch()
        with watch.stage("hand over"):
            self._family.elements.foreach_set("co", self._positions.reshape(-1))
        self._family.update_tag()
        with watch.stage("surface"):
            self._depsgraph.update()
            self._object.evaluated_get(self._depsgraph).to_mesh()
        return watch.milliseconds

    def mesh(self) -> Mesh:
        return self._as_mesh(self._object.evaluated_get(self._depsgraph).to_mesh())


def _new_family(family: bpy.types.MetaBall, task: Task) -> bpy.types.MetaBall:
    """Fill in the elements, which lie in the origin until they are handed over."""
    family.threshold = task.isovalue
    family.resolution = family.render_resolution = task.options["resolution"]
    for _ in range(len(task.positions)):
        family.elements.new()
    for name in ("radius", "stiffness"):
        family.elements.foreach_set(name, np.ones(len(task.positions), np.float32))
    return family


create = Metaballs
