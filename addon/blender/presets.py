"""Settings that go together: how a scene's fluid is to look."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from ..fluid.field import Field
from ..fluid.look import Look
from ..fluid.tracing import Tracing


@dataclass(frozen=True)
class Preset:
    """Settings of a scene.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    field, look
        What is set; what they leave out goes back to its default.
    tracing, transmission
        The same for renders, which show materials: how light is traced, and how much of it passes through fluid that has no
        material.
    """

    name: str
    label: str
    description: str
    field: Field
    look: Look
    tracing: Tracing
    transmission: float = 0.0


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            "water",
            "Water",
            "Clear, reflects the sky and is blue where it is deep",
            Field(),
            Look(style="water", color=(0.03, 0.24, 0.42), roughness=0.1, absorption=2.0, ior=1.33),
            Tracing(reflections=3, refractions=8),
            transmission=1.0,
        ),
        Preset(
            "slime",
            "Slime",
            "Thick, green and wet",
            Field("poly6", 0.12),
            Look(style="studio", color=(0.10, 0.42, 0.04), roughness=0.12, ambient=0.3),
            Tracing(reflections=2, refractions=4, occlusion_rays=4),
            transmission=0.4,
        ),
        Preset(
            "mercury",
            "Mercury",
            "A mirror of liquid metal",
            Field("wyvill", 0.25),
            Look(style="studio", color=(0.72, 0.74, 0.76), roughness=0.05, metallic=1.0, ambient=0.1),
            Tracing(reflections=3, refractions=0),
        ),
        Preset(
            "molecules",
            "Molecules",
            "Each ball shows, and blends only where it touches the next",
            Field("power_4", 0.4),
            Look(style="studio", color=(0.62, 0.08, 0.06), roughness=0.45, ambient=0.35),
            Tracing(reflections=1, refractions=0, occlusion_rays=16),
        ),
    )
}

_SETTINGS = (
    "style",
    "color",
    "ambient",
    "roughness",
    "metallic",
    "light",
    "light_strength",
    "absorption",
    "ior",
    "depth_contrast",
    "depth_contrast_radius",
)


def apply_preset(scene: bpy.types.Scene, preset: Preset) -> None:
    """Give a scene the settings of a preset."""
    settings = scene.meniscus
    settings.kernel, settings.isovalue = preset.field.kernel, preset.field.isovalue
    for name in _SETTINGS:
        setattr(settings, name, getattr(preset.look, name))
    settings.render_style, settings.transmission = "material", preset.transmission
    _apply_tracing(settings, preset.tracing)


def _apply_tracing(settings: bpy.types.PropertyGroup, tracing: Tracing) -> None:
    settings.use_tracing, settings.use_tracing_shadows = True, tracing.shadows
    settings.tracing_reflections, settings.tracing_refractions = tracing.reflections, tracing.refractions
    settings.use_tracing_occlusion = tracing.occlusion_rays > 0
    settings.property_unset("tracing_occlusion_rays")
    if tracing.occlusion_rays > 0:
        settings.tracing_occlusion_rays = tracing.occlusion_rays
    settings.tracing_occlusion_distance = tracing.occlusion_distance if math.isfinite(tracing.occlusion_distance) else 0.0
    settings.tracing_samples = tracing.samples
