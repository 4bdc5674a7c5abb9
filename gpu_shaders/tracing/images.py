"""Traces the light of images that lie in the memory of the CPU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ...addon.fluid.camera import Camera
from ...addon.fluid.errors import MeniscusError
from ...addon.fluid.lighting import Lighting
from ...addon.fluid.tracing import Tracing
from ..context import GpuContext, shared_context
from ..surface_textures import SurfaceTextures
from .stage import TracedFluid, TracedLight, TracedMeshes

__all__ = ["ImageTracer", "TracedFluid", "TracedMeshes", "image_tracer"]

FloatArray = npt.NDArray[np.float32]

_RAYS_AT_ONCE = 1 << 28
"""About so many rays are asked of the processor before the user is: more might be taken for a program that hangs."""


class ImageTracer:
    """Traces images on one OpenGL context; its methods may be called from any thread."""

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._stage = TracedLight(context)

    def trace(
        self,
        depth: FloatArray,
        normal: FloatArray,
        camera: Camera,
        fluid: TracedFluid,
        lighting: Lighting,
        tracing: Tracing,
        irradiance: FloatArray | None,
        image: int,
        is_film_clear: bool,
        watch: Callable[[float], None],
    ) -> FloatArray:
        """(height, width, 4): what :meth:`stage.TracedLight.trace` gives.

        Parameters
        ----------
        depth, normal
            (height, width) planar and (height, width, 3) in world space, row 0 at the bottom.
        camera, fluid, lighting, tracing, irradiance, is_film_clear
            As for that.
        image
            How many images of this view were made before, each with as many samples.
        watch
            Is called with the share of the work that is done; what it raises is passed on.

        Raises
        ------
        DeviceError
            The graphics processor has too little memory, or fails.
        """
        rays = depth.size * (1 + tracing.occlusion_rays)
        most = max(1, min(tracing.samples, _RAYS_AT_ONCE // max(rays, 1)))
        total = np.zeros((*depth.shape, 4), np.float32)
        for first in range(0, tracing.samples, most):
            watch(first / tracing.samples)
            part = replace(tracing, samples=min(most, tracing.samples - first))
            number = image * tracing.samples + first
            work = partial(self._trace, depth, normal, camera, fluid, lighting, part, irradiance, number, is_film_clear)
            try:
                total += self._context.run(work) * np.float32(part.samples / tracing.samples)
            except MeniscusError:
                self._stage = TracedLight(self._context)  # what was uploaded may be of no use
                raise
        return total

    def _trace(
        self,
        depth: FloatArray,
        normal: FloatArray,
        camera: Camera,
        fluid: TracedFluid,
        lighting: Lighting,
        tracing: Tracing,
        irradiance: FloatArray | None,
        first_sample: int,
        is_film_clear: bool,
    ) -> FloatArray:
        """On the context's thread."""
        height, width = depth.shape
        surface = SurfaceTextures(self._context, (width, height))
        surface.textures["depth"].write(np.ascontiguousarray(depth, np.float32))
        surface.textures["normal"].write(np.concatenate([normal, np.zeros((height, width, 1), np.float32)], axis=2))
        light = self._stage.trace(surface, camera, fluid, lighting, tracing, irradiance, first_sample, is_film_clear)
        return np.frombuffer(light.read(), np.float32).reshape(height, width, 4)


def image_tracer() -> ImageTracer:
    """That of the process's context; DeviceError where there is none."""
    return shared_context().kept(ImageTracer)
