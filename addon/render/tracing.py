"""Traced light, by the native core: shadows, reflections, refraction, ambient occlusion; docs/light.md has the formulas."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.field import Field
from ..fluid.lighting import Lighting, Material, WorldImage
from ..fluid.meshes import Meshes
from ..fluid.tracing import Tracing
from . import native
from .fitted_bvh import FittedBvh
from .material_shading import light_tuples, material_tuples
from .vector_math import FloatArray

IntArray = npt.NDArray[np.int32]
Watch = Callable[[float], None]
Tracer = Callable[..., None]
"""With the parameters of :func:`trace_image`."""

_UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

_MOST_KEPT = 16


@dataclass(frozen=True)
class SeenSurface:
    """The first surface of each pixel of an image, whatever found it.

    Attributes
    ----------
    depth, normal, color
        (height, width) planar, and (height, width, 3) in world space and linear Rec.709.
    material
        (height, width) int32: of the fluid's materials and then the meshes'; negative where nothing is to be traced.
    ball
        (height, width) int32: the ball with the greatest share; negative where a mesh is seen.
    """

    depth: FloatArray
    normal: FloatArray
    color: FloatArray
    material: IntArray
    ball: IntArray


@dataclass(frozen=True)
class TracedScene:
    """What light meets.

    Attributes
    ----------
    balls, field
        The fluid.
    materials
        Of its sources, see :attr:`balls.Balls.sources`; their colours count where the balls have none.
    lighting
        In world space.
    meshes
        What else there is; None for nothing.
    """

    balls: Balls
    field: Field
    materials: tuple[Material, ...]
    lighting: Lighting
    meshes: Meshes | None = None


def trace_image(
    rgba: FloatArray,
    seen: SeenSurface,
    camera: Camera,
    scene: TracedScene,
    tracing: Tracing,
    contrast: FloatArray | None = None,
    image: int = 0,
    is_film_clear: bool = False,
    threads: int = 0,
    watch: Watch = native.let_interrupt,
) -> None:
    """Trace the light that the surface of an image sends to the eye.

    Parameters
    ----------
    rgba
        (height, width, 4) premultiplied, linear Rec.709: is written where something is traced.
    seen, camera
        What the image shows, and from where; the camera has no region.
    scene, tracing
        What light meets, and how far it is followed.
    contrast
        (height, width): a factor of the light; None for 1.
    image
        How many images of this view were made before: each has other samples, and their mean has less noise.
    is_film_clear
        Whether the world that is seen straight through surfaces is left out, and makes the image transparent.
    threads, watch
        As for :class:`method.Request`.

    Raises
    ------
    InputError
        A material has no usable index of refraction.
    DeviceError
        The native core is missing, or there is too little memory.
    """
    core = native.load()
    balls, lighting = scene.balls, scene.lighting
    fluid = KEPT.made(balls, scene.field, lambda: FittedBvh(balls, scene.field, threads=threads, watch=watch).native)
    with native.translated_errors():
        core.trace_image(
            rgba,
            *map(np.ascontiguousarray, (seen.depth, seen.normal, seen.color, seen.material, seen.ball)),
            None if contrast is None else np.ascontiguousarray(contrast),
            native.view_tuple(camera),
            fluid=(fluid, balls.radii, balls.colors, balls.sources),
            meshes=_mesh_arguments(core, scene, threads, watch),
            materials=material_tuples(scene.materials + (scene.meshes.materials if scene.meshes else ())),
            lights=light_tuples(lighting.lights),
            distant=(lighting.world, *_world_arguments(lighting.image)),
            tracing=(
                *(tracing.reflections, tracing.refractions, tracing.shadows),
                *(tracing.occlusion_rays, tracing.occlusion_distance, tracing.samples),
            ),
            number=image,
            is_film_clear=is_film_clear,
            threads=threads,
            watch=watch,
        )


def world_seen(camera: Camera, lighting: Lighting, threads: int = 0, watch: Watch = native.let_interrupt) -> FloatArray:
    """What a camera, which has no region, sees of the world: (height, width, 4), linear Rec.709, opaque.

    `threads` and `watch` are as for :class:`method.Request`.
    """
    core = native.load()
    rgba = np.empty((camera.height, camera.width, 4), np.float32)
    distant = lighting.world, *_world_arguments(lighting.image)
    with native.translated_errors():
        core.show_world(rgba, native.view_tuple(camera), distant=distant, threads=threads, watch=watch)
    return rgba


def _mesh_arguments(core: Any, scene: TracedScene, threads: int, watch: Watch) -> tuple[Any, FloatArray, IntArray]:
    """The tree of the triangles, their normals and their materials, behind those of the fluid."""
    meshes = scene.meshes
    if meshes is None:
        none = np.empty((0, 3), np.int32)
        return core.Triangles(np.empty((0, 3), np.float32), none), np.empty((0, 9), np.float32), none[:, 0]
    return (
        triangle_tree(meshes, threads, watch),
        meshes.normals.reshape(-1, 9),
        meshes.material + np.int32(len(scene.materials)),
    )


def triangle_tree(meshes: Meshes, threads: int, watch: Watch) -> Any:
    """The native core's tree over triangles, which is kept as long as these live."""
    made = native.load().Triangles
    return KEPT.made(meshes, None, lambda: made(meshes.vertices, meshes.triangles, threads=threads, watch=watch))


def world_image(image: WorldImage) -> Any:
    """The native core's image of the world, which is kept as long as that lives."""
    made = native.load().WorldImage
    return KEPT.made(image, None, lambda: made(np.ascontiguousarray(image.pixels)))


def _world_arguments(image: WorldImage | None) -> tuple[Any, Any]:
    """The image of the world, or None, and the rotation into its space."""
    return (None, _UPRIGHT) if image is None else (world_image(image), image.image_from_world)


class _Kept:
    """What was made of the last few objects, as long as these live: the samples of an image share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: dict[tuple[int, Hashable], tuple[weakref.ref[Any], Any]] = {}

    def made(self, owner: Any, further: Hashable, make: Callable[[], Any]) -> Any:
        """What `make` gives for an object, and for whatever else it depends on."""
        key = id(owner), further
        with self._lock:
            kept = self._made.get(key)
        if kept is not None and kept[0]() is owner:
            return kept[1]
        made = make()
        with self._lock:
            living = {key: kept for key, kept in self._made.items() if kept[0]() is not None}
            self._made = dict(list(living.items())[1 - _MOST_KEPT :])
            self._made[key] = weakref.ref(owner, lambda _: self._forget(key)), made
        return made

    def _forget(self, key: tuple[int, Hashable]) -> None:
        # An object dies on any thread, also on one that holds the lock; to remove one entry needs none.
        self._made.pop(key, None)


KEPT = _Kept()
