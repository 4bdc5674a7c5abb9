"""The meshes of a scene, which hide fluid and are hidden by it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .lighting import Material


@dataclass(frozen=True)
class MeshObject:
    """An object with triangles.

    Attributes
    ----------
    name
        Its name.
    pass_index
        The number that it has in the Object Index pass.
    is_holdout
        Whether it leaves a hole in the image.
    is_seen
        Whether cameras see it.
    is_traced
        Whether traced light meets it.
    """

    name: str
    pass_index: int = 0
    is_holdout: bool = False
    is_seen: bool = True
    is_traced: bool = True


@dataclass(frozen=True, eq=False)
class MeshPart:
    """One mesh at one place among many.

    Attributes
    ----------
    key
        What names it in all frames.
    first_vertex, vertex_count
        Its vertices among those of all.
    triangle_count
        How many it has.
    world_from_object
        (4, 4) float64: its place.
    """

    key: Hashable
    first_vertex: int
    vertex_count: int
    triangle_count: int
    world_from_object: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Meshes:
    """Triangles, world space, Blender units; two are the same only where they are one.

    Attributes
    ----------
    vertices
        (V, 3) float32.
    triangles
        (T, 3) int32: the vertices of the corners.
    normals
        (T, 3, 3) float32: unit, of each corner.
    object, material
        (T,) int32: indices into `objects` and `materials`.
    objects, materials
        What the triangles belong to.
    parts
        What the vertices belong to; none where meshes of several frames need not be told apart.

    Raises
    ------
    InputError
        An array has another shape or type, or an index is out of range.
    """

    vertices: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    normals: npt.NDArray[np.float32]
    object: npt.NDArray[np.int32]
    material: npt.NDArray[np.int32]
    objects: tuple[MeshObject, ...]
    materials: tuple[Material, ...]
    parts: tuple[MeshPart, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.triangles)
        expected = {
            "vertices": ((len(self.vertices), 3), np.float32),
            "triangles": ((count, 3), np.int32),
            "normals": ((count, 3, 3), np.float32),
            "object": ((count,), np.int32),
            "material": ((count,), np.int32),
        }
        for name, (shape, dtype) in expected.items():
            array = getattr(self, name)
            if array.shape != shape or array.dtype != dtype:
                raise InputError(
                    f"{name} of meshes must be {np.dtype(dtype)} of the shape {shape}, not {array.dtype} of {array.shape}"
                )
        for name, limit in (
            ("triangles", len(self.vertices)),
            ("object", len(self.objects)),
            ("material", len(self.materials)),
        ):
            array = getattr(self, name)
            if count and not (array.min() >= 0 and array.max() < limit):
                raise InputError(f"An index in {name} of meshes is out of range")

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def seen(self) -> Meshes:
        """Those of the triangles that cameras see; vertices, objects and materials stay what they are."""
        return self._those([item.is_seen for item in self.objects])

    @cached_property
    def traced(self) -> Meshes:
        """Those of the triangles that traced light meets; vertices, objects and materials stay what they are."""
        return self._those([item.is_traced for item in self.objects])

    @cached_property
    def unseen(self) -> Meshes:
        """The same, seen by no camera."""
        return replace(self, objects=tuple(replace(item, is_seen=False) for item in self.objects))

    @cached_property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3): the box around the vertices; there must be some."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)], np.float64)

    def _those(self, are_wanted: list[bool]) -> Meshes:
        if all(are_wanted):
            return self
        wanted = np.array(are_wanted)[self.object]
        return replace(
            self,
            triangles=self.triangles[wanted],
            normals=self.normals[wanted],
            object=self.object[wanted],
            material=self.material[wanted],
        )
