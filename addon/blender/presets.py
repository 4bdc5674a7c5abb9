"""Settings that go together: how a scene's fluid is to look."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..fluid.field import Field
from ..fluid.look import Look


@dataclass(frozen=True)
class Preset:
    """Settings of a scene.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    field, look
        What is set; what they leave out goes back to its default.
    """

    name: str
    label: str
    description: str
    field: Field
    look: Look


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            "water",
            "Water",
            "Clear, reflects the sky and is blue where it is deep",
            Field(),
            Look(style="water", color=(0.03, 0.24, 0.42), roughness=0.1, absorption=2.0, ior=1.33),
        ),
        Preset(
            "slime",
            "Slime",
            "Thick, green and wet",
            Field("poly6", 0.12),
            Look(style="studio", color=(0.10, 0.42, 0.04), roughness=0.12, ambient=0.3),
        ),
        Preset(
            "mercury",
            "Mercury",
            "A mirror of liquid metal",
            Field("wyvill", 0.25),
            Look(style="studio", color=(0.72, 0.74, 0.76), roughness=0.05, metallic=1.0, ambient=0.1),
        ),
        Preset(
            "molecules",
            "Molecules",
            "Each ball shows, and blends only where it touches the next",
            Field("power_4", 0.4),
            Look(style="studio", color=(0.62, 0.08, 0.06), roughness=0.45, ambient=0.35),
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
