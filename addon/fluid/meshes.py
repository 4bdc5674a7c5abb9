"""The meshes of a scene, which hide fluid and are hidden by it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from itertools import accumulate

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
    """

    name: str
    pass_index: int = 0
    is_holdout: bool = False


@dataclass(frozen=True)
class MeshPart:
    """One mesh at one place among many.

    Attributes
    ----------
    key
        What names it in all frames.
    vertex_count, triangle_count
        How many it has.
    """

    key: Hashable
    vertex_count: int
    triangle_count: int


@dataclass(frozen=True)
class Meshes:
    """Triangles, world space, Blender units.

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
        Which follow one another in the arrays; none where meshes of several frames need not be told apart.

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

    def vertices_in(self, other: Meshes) -> npt.NDArray[np.float32] | None:
        """(V, 3) float32: where the vertices are in another frame; None where all are where they are.

        Parts that are not there, or have other numbers of vertices or triangles, stand still.
        """
        there = dict(zip(other.parts, _starts(other.parts), strict=True))
        vertices = self.vertices.copy()
        for part, start in zip(self.parts, _starts(self.parts), strict=True):
            found = there.get(part)
            if found is not None:
                vertices[start : start + part.vertex_count] = other.vertices[found : found + part.vertex_count]
        return None if np.array_equal(vertices, self.vertices) else vertices


def _starts(parts: tuple[MeshPart, ...]) -> list[int]:
    """The first vertex of each part."""
    return list(accumulate((part.vertex_count for part in parts), initial=0))[:-1]
