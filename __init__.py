"""Meniscus: the blended surface of particle fluids, ray-cast straight from the particles.

Inside Blender this package is an extension; in the development environment it imports as ``meniscus``. Nothing heavy is
imported here: the names below load when they are first used, and ``register`` loads the Blender side.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "Balls": ".addon.fluid.balls",
    "colored_by_cluster": ".addon.render.cluster_numbers",
    "Camera": ".addon.fluid.camera",
    "DeepImage": ".addon.fluid.deep_image",
    "DensityProfile": ".addon.fluid.density_profile",
    "Field": ".addon.fluid.field",
    "find_clusters": ".addon.render.clusters",
    "FittedBvh": ".addon.render.fitted_bvh",
    "ImageBuffers": ".addon.fluid.image",
    "Instant": ".addon.render.instant",
    "Look": ".addon.fluid.look",
    "Sequence": ".addon.render.instant",
    "SurfaceParticles": ".addon.render.surface_particles",
    "Tracing": ".addon.fluid.tracing",
    "MeniscusError": ".addon.fluid.errors",
    "methods": ".addon.render.registry",
    "oracle": ".addon.render.oracle",
    "render": ".addon.render.renderer",
    "render_deep": ".addon.render.deep",
    "render_progressively": ".addon.render.renderer",
    "write_deep_exr": ".addon.output.exr",
    "write_exr": ".addon.output.exr",
}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    module = importlib.import_module(_HOMES[name], __name__)
    value = module if _HOMES[name].endswith(f".{name}") else getattr(module, name)
    globals()[name] = value
    return value


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from .addon import blender

    blender.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    from .addon import blender

    blender.unregister()
