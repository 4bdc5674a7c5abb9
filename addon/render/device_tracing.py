"""Traced light on the graphics processor, with the pictures of the native core."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..fluid.camera import Camera
from ..fluid.lighting import WorldImage
from ..fluid.meshes import Meshes
from ..fluid.tracing import Tracing
from . import native
from .registry import tracing_stage
from .tracing import KEPT, SeenSurface, TracedScene, Watch, trace_image, triangle_tree, world_image
from .tree_builder import TREES
from .vector_math import FloatArray


def trace_image_on_device(
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
    """Trace the light of an image on the graphics processor, or by the native core where there is no fluid.

    The parameters and the errors are those of :func:`tracing.trace_image`; DeviceError where the graphics processor fails, too.
    """
    if len(scene.balls) == 0:
        trace_image(rgba, seen, camera, scene, tracing, contrast, image, is_film_clear, threads, watch)
        return
    stage = tracing_stage()
    tree = TREES.tree(scene.balls, scene.field, threads, watch)
    meshes = None if scene.meshes is None else _traced_meshes(stage, scene.meshes, threads, watch)
    fluid = stage.TracedFluid(tree.arrays, scene.balls, scene.field, scene.materials, meshes)
    lighting = scene.lighting
    irradiance = None if lighting.image is None else _irradiance(lighting.image)
    tracer = stage.image_tracer()
    found = tracer.trace(*(seen.depth, seen.normal, camera, fluid, lighting, tracing, irradiance, image, is_film_clear, watch))
    if contrast is not None:
        found[..., :3] *= contrast[..., None]
    np.copyto(rgba, found, where=(seen.material >= 0)[..., None])


def _traced_meshes(stage: Any, meshes: Meshes, threads: int, watch: Watch) -> Any:
    """Triangles as shaders take them: the same for the same meshes, None where there are none."""
    if not len(meshes):
        return None

    def make() -> Any:
        with native.translated_errors():
            return stage.TracedMeshes(meshes, *triangle_tree(meshes, threads, watch).arrays())

    return KEPT.made(meshes, "device", make)


def _irradiance(image: WorldImage) -> Any:
    """What surfaces of each direction get of the world, see :meth:`stage.TracedLight.trace`; the same for the same image."""
    with native.translated_errors():
        return KEPT.made(image, "irradiance", lambda: world_image(image).irradiance())
