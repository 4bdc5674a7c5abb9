"""Meshes as a camera sees them: what hides the fluid, plainly shaded or as holes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.lighting import Lighting
from ..fluid.meshes import Meshes
from ..fluid.passes import DEPTH_BACKGROUND
from . import native
from .material_shading import lighting_in_view, lit_materials, material_parameters
from .shading import directions_to_eye, view_normals
from .surroundings import Backdrop
from .vector_math import FloatArray

_HOLE = (0.0, 0.0, 0.0, 0.0)


def backdrop(
    meshes: Meshes,
    camera: Camera,
    lighting: Lighting,
    background: tuple[float, float, float, float],
    are_holdouts: bool = False,
    threads: int = 0,
    watch: Callable[[float], None] = native.let_interrupt,
) -> Backdrop:
    """What is seen where no fluid is.

    Parameters
    ----------
    meshes, lighting
        What there is, and its light.
    camera
        What the image shows; it has no region.
    background
        What is seen where there is nothing: linear Rec.709, premultiplied alpha.
    are_holdouts
        Whether all meshes leave holes; else those do that say so.
    threads, watch
        As for :class:`method.Request`.

    Raises
    ------
    DeviceError
        The native core is missing, or there is too little memory.
    """
    if not len(meshes):
        return Backdrop.empty(camera, background)
    depth, triangle, normal = _rasterized(meshes, camera, threads, watch)
    hit = triangle >= 0
    found = triangle[hit]
    objects = np.full(hit.shape, -1, np.int32)
    objects[hit] = meshes.object[found]
    holds_out = np.array([are_holdouts or item.is_holdout for item in meshes.objects])
    is_holdout = hit & holds_out[objects]
    shown = hit & ~is_holdout
    rgba, color = np.empty((*hit.shape, 4), np.float32), np.zeros((*hit.shape, 3), np.float32)
    rgba[:] = background
    rgba[is_holdout] = _HOLE
    if shown.any():
        materials = meshes.material[triangle[shown]]
        color[shown] = np.array([material.color for material in meshes.materials], np.float32)[materials]
        rgba[shown] = _shaded(meshes, camera, lighting, shown, depth, normal, color, materials, rgba)
    return Backdrop(
        rgba=rgba,
        depth=depth,
        normal=normal,
        color=color,
        object=objects,
        is_holdout=is_holdout,
        names=tuple(item.name for item in meshes.objects),
        pass_indices=tuple(item.pass_index for item in meshes.objects),
    )


def _rasterized(
    meshes: Meshes, camera: Camera, threads: int, watch: Callable[[float], None]
) -> tuple[FloatArray, npt.NDArray[np.int32], FloatArray]:
    """Planar depth, triangle (-1 for none) and normal, towards the eye, of each pixel."""
    shape = camera.height, camera.width
    depth, triangle, normal = np.empty(shape, np.float32), np.empty(shape, np.int32), np.empty((*shape, 3), np.float32)
    core = native.load()
    with native.translated_errors():
        core.rasterize(
            meshes.vertices,
            meshes.triangles,
            meshes.normals.reshape(-1, 9),
            depth,
            triangle,
            normal,
            background=DEPTH_BACKGROUND,
            **native.view_arguments(camera),
            threads=threads,
            watch=watch,
        )
    return depth, triangle, normal


def _shaded(
    meshes: Meshes,
    camera: Camera,
    lighting: Lighting,
    shown: npt.NDArray[np.bool_],
    depth: FloatArray,
    normal: FloatArray,
    color: FloatArray,
    materials: npt.NDArray[np.int32],
    behind: FloatArray,
) -> FloatArray:
    """(count, 4): light of what is shown over what is behind it, a part of which clear materials let pass."""
    radiance, transmittance = lit_materials(
        view_normals(normal[shown], camera),
        directions_to_eye(camera, shown),
        camera.view_positions(shown, depth),
        color[shown],
        material_parameters(meshes.materials, materials),
        lighting_in_view(lighting, camera.view_from_world),
    )
    below = behind[shown]
    alpha = 1 - transmittance.mean(axis=1, keepdims=True) * (1 - below[:, 3:])
    return np.concatenate([radiance + transmittance * below[:, :3], alpha], axis=1, dtype=np.float32)
