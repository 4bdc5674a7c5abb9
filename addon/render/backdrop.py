"""Meshes as a camera sees them: what hides the fluid, plainly shaded or as holes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.lighting import Lighting
from ..fluid.meshes import Meshes
from ..fluid.passes import DEPTH_BACKGROUND
from . import native
from .material_shading import shade_image
from .surroundings import Backdrop, Color, Motion
from .tracing import world_seen
from .vector_math import FloatArray

_HOLE = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Surroundings:
    """What else than fluid there is in a scene, whoever looks at it.

    Attributes
    ----------
    meshes
        None where they are neither seen nor traced.
    lighting
        Lights and world.
    is_film_clear
        Whether images are transparent where the world would be seen.
    are_holdouts
        Whether all meshes leave holes.
    """

    meshes: Meshes | None
    lighting: Lighting
    is_film_clear: bool
    are_holdouts: bool = False

    def backdrop(
        self,
        camera: Camera,
        threads: int = 0,
        watch: Callable[[float], None] = native.let_interrupt,
        motion: Motion | None = None,
    ) -> Backdrop | None:
        """What a camera, which has no region, sees of it; None where that is nothing. For the rest see :func:`backdrop`."""
        background: Color | FloatArray = _HOLE if self.is_film_clear else (*self.lighting.world, 1.0)
        if not self.is_film_clear and self.lighting.image is not None:
            background = world_seen(camera, self.lighting, threads, watch)
        if self.meshes is None or not len(self.meshes):
            return None if self.is_film_clear else Backdrop.empty(camera, background)
        return backdrop(
            self.meshes, camera, self.lighting, background, self.are_holdouts, threads=threads, watch=watch, motion=motion
        )


def backdrop(
    meshes: Meshes,
    camera: Camera,
    lighting: Lighting,
    background: Color | FloatArray,
    are_holdouts: bool = False,
    threads: int = 0,
    watch: Callable[[float], None] = native.let_interrupt,
    motion: Motion | None = None,
) -> Backdrop:
    """What is seen where no fluid is.

    Parameters
    ----------
    meshes, lighting
        What there is, and its light.
    camera
        What the image shows; it has no region.
    background
        What is seen where there is nothing: linear Rec.709, premultiplied alpha; one colour, or (height, width, 4).
    are_holdouts
        Whether all meshes leave holes; else those do that say so.
    threads, watch
        As for :class:`method.Request`.
    motion
        Of the meshes, for the Vector pass; None where it is not asked for.

    Raises
    ------
    DeviceError
        The native core is missing, or there is too little memory.
    """
    traced, meshes = meshes.traced, meshes.seen
    if not len(meshes):
        return replace(Backdrop.empty(camera, background), meshes=traced)
    depth, triangle, normal = _rasterized(meshes, camera, threads, watch)
    hit = triangle >= 0
    found = triangle[hit]
    objects = np.full(hit.shape, -1, np.int32)
    objects[hit] = meshes.object[found]
    holds_out = np.array([are_holdouts or item.is_holdout for item in meshes.objects])
    is_holdout = hit & holds_out[objects]
    shown = hit & ~is_holdout
    material = np.where(shown, meshes.material[triangle], np.int32(-1))
    rgba, color = np.empty((*hit.shape, 4), np.float32), np.zeros((*hit.shape, 3), np.float32)
    rgba[:] = background
    rgba[is_holdout] = _HOLE
    if shown.any():
        color[shown] = np.array([item.color for item in meshes.materials], np.float32)[material[shown]]
        shade_image(rgba, depth, normal, color, material, camera, meshes.materials, lighting, threads=threads, watch=watch)
    sides = (None, None) if motion is None else (motion.previous_vertices, motion.following_vertices)
    to_previous, to_following = (
        None if vertices is None else _displacement(meshes, vertices, triangle, camera, threads, watch) for vertices in sides
    )
    return Backdrop(
        rgba=rgba,
        depth=depth,
        normal=normal,
        color=color,
        object=objects,
        is_holdout=is_holdout,
        names=tuple(item.name for item in meshes.objects),
        pass_indices=tuple(item.pass_index for item in meshes.objects),
        is_film_clear=not np.any(np.asarray(background)[..., 3]),
        meshes=traced,
        material=material,
        to_previous=to_previous,
        to_following=to_following,
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


def _displacement(
    meshes: Meshes,
    vertices: FloatArray,
    triangle: npt.NDArray[np.int32],
    camera: Camera,
    threads: int,
    watch: Callable[[float], None],
) -> FloatArray:
    """(height, width, 3): the way from what is seen at each pixel to where it is while the meshes have other vertices."""
    displacement = np.empty((*triangle.shape, 3), np.float32)
    core = native.load()
    with native.translated_errors():
        core.displace(
            meshes.vertices,
            meshes.triangles,
            meshes.normals.reshape(-1, 9),
            vertices,
            triangle,
            displacement,
            **native.view_arguments(camera),
            threads=threads,
            watch=watch,
        )
    return displacement
