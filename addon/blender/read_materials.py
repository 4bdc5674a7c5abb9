"""Materials of a Blender scene, as far as a look can show them."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..fluid.lighting import FluidSource, Material, Vector
from .nodes import NodeValues, output_source, scaled
from .scene_notes import note

_BLACK, _WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def read_source(
    item: bpy.types.Object, view_layer: bpy.types.ViewLayer, settings: bpy.types.PropertyGroup, uses_materials: bool
) -> FluidSource:
    """What a render knows of an evaluated object that supplies balls.

    Parameters
    ----------
    settings
        Those of the scene: it looks as they say where it has no material.
    uses_materials
        Whether its material is read at all.
    """
    is_holdout = item.is_holdout or item.original.holdout_get(view_layer=view_layer)
    read = _material_of_source(item, view_layer, settings) if uses_materials else Material()
    has_cluster_colors = item.meniscus.color_mode == "CLUSTER"
    return FluidSource(item.name, item.pass_index, read, is_holdout, has_cluster_colors)


def _material_of_source(item: bpy.types.Object, view_layer: bpy.types.ViewLayer, settings: bpy.types.PropertyGroup) -> Material:
    material = view_layer.material_override or _material_of(item)
    return _plain_material(settings) if material is None else read_material(material)


def read_material(material: bpy.types.Material | None) -> Material:
    """A material as its Principled BSDF, or another simple shader, and its volume have it.

    Inputs that are linked to other nodes differ from place to place: for them the settings of the viewport display count, or
    the defaults. So they do where the surface is made of other nodes.
    """
    if material is None:
        return Material()
    plain = Material(tuple(material.diffuse_color[:3]), material.metallic, material.roughness)
    surface, volume = output_source(material, "Surface"), output_source(material, "Volume")
    absorption = _absorption(material, volume)
    if surface is None:
        # What has a volume alone bends no light.
        return plain if volume is None else Material(_WHITE, roughness=0.0, transmission=1.0, ior=1.0, absorption=absorption)
    read = _SHADERS.get(surface.type)
    if read is None:
        _note_unread(material, f"its surface is made by the node '{surface.name}'")
        return Material(plain.color, plain.metallic, plain.roughness, absorption=absorption)
    values = NodeValues(surface)
    found = read(values, plain)
    if values.unread:
        _note_unread(material, f"nodes are linked to its {' and '.join(values.unread)}")
    return Material(**{"absorption": absorption, **found})


def _note_unread(material: bpy.types.Material, reason: str) -> None:
    note(f"'{material.name}' is shown with the colours of its viewport display, because {reason}")


def _material_of(item: bpy.types.Object) -> bpy.types.Material | None:
    """The material of an object's first particle system that is not hair, else its first one."""
    slots = item.material_slots
    numbers = [system.settings.material for system in item.particle_systems if system.settings.type != "HAIR"]
    slot = min(numbers[0], len(slots)) - 1 if numbers else 0
    return slots[slot].material if len(slots) else None


def _plain_material(settings: bpy.types.PropertyGroup) -> Material:
    """What the settings of a scene say of fluid without a material."""
    clear, color = settings.transmission, tuple(settings.color)
    return Material(
        # Clear fluid has its colour from what it takes away, as in the look Water.
        color=tuple(clear + (1.0 - clear) * channel for channel in color),
        metallic=settings.metallic,
        roughness=settings.roughness,
        transmission=clear,
        ior=settings.ior,
        absorption=tuple(settings.absorption * max(1.0 - channel, 0.0) for channel in color) if clear > 0 else _BLACK,
    )


def _principled(values: NodeValues, plain: Material) -> dict[str, object]:
    return {
        "color": values.color("Base Color", plain.color),
        "metallic": values.number("Metallic", plain.metallic),
        "roughness": values.number("Roughness", plain.roughness),
        "transmission": values.number("Transmission Weight", 0.0),
        "ior": values.number("IOR", 1.5),
        "emission": scaled(values.color("Emission Color", _BLACK), values.number("Emission Strength", 0.0)),
    }


def _glass(values: NodeValues, plain: Material) -> dict[str, object]:
    return {
        "color": _squared(values.color("Color", plain.color)),
        "roughness": values.number("Roughness", plain.roughness),
        "transmission": 1.0,
        "ior": values.number("IOR", 1.5),
    }


def _transparent(values: NodeValues, plain: Material) -> dict[str, object]:
    return {"color": _squared(values.color("Color", plain.color)), "roughness": 0.0, "transmission": 1.0, "ior": 1.0}


def _glossy(values: NodeValues, plain: Material) -> dict[str, object]:
    color = values.color("Base Color" if values.node.type == "BSDF_METALLIC" else "Color", plain.color)
    return {"color": color, "metallic": 1.0, "roughness": values.number("Roughness", plain.roughness)}


def _diffuse(values: NodeValues, plain: Material) -> dict[str, object]:
    return {"color": values.color("Color", plain.color), "roughness": 1.0, "ior": 1.0}


def _emission(values: NodeValues, plain: Material) -> dict[str, object]:
    radiance = scaled(values.color("Color", plain.color), values.number("Strength", 1.0))
    return {"color": _BLACK, "roughness": 1.0, "ior": 1.0, "emission": radiance}


_SHADERS: dict[str, Callable[[NodeValues, Material], dict[str, object]]] = {
    "BSDF_PRINCIPLED": _principled,
    "BSDF_GLASS": _glass,
    "BSDF_REFRACTION": _glass,
    "BSDF_TRANSPARENT": _transparent,
    "BSDF_GLOSSY": _glossy,
    "BSDF_METALLIC": _glossy,
    "BSDF_DIFFUSE": _diffuse,
    "EMISSION": _emission,
}
"""What each shader node says of a material, by the node's type."""


def _squared(color: Vector) -> Vector:
    """The base colour of what has a colour at each surface: a Principled BSDF takes the root there."""
    return color[0] ** 2, color[1] ** 2, color[2] ** 2


def _absorption(material: bpy.types.Material, volume: bpy.types.Node | None) -> Vector:
    """What the volume of a material takes away a Blender unit, as Cycles has it; light that it scatters is not followed."""
    if volume is None:
        return _BLACK
    read = _VOLUMES.get(volume.type)
    values = NodeValues(volume)
    found = _BLACK if read is None else read(values)
    if read is None or values.unread:
        note(f"The volume of '{material.name}' is left out or simplified: only Volume Absorption, Principled Volume and Volume "
             "Coefficients without textures are shown")  # fmt: skip
    return found


def _absorbed(values: NodeValues) -> Vector:
    return _taken(values.color("Color", _WHITE), values.number("Density", 1.0))


def _principled_volume(values: NodeValues) -> Vector:
    density = values.number("Density", 1.0)
    scattered = _taken(values.color("Color", _WHITE), 1.0)
    kept = values.color("Absorption Color", _BLACK)
    red, green, blue = (
        density * part * max(1.0 - max(share, 0.0) ** 0.5, 0.0) for part, share in zip(scattered, kept, strict=True)
    )
    return red, green, blue


def _coefficients(values: NodeValues) -> Vector:
    return values.color("Absorption Coefficients", _BLACK)


def _taken(color: Vector, density: float) -> Vector:
    red, green, blue = (max(1.0 - channel, 0.0) * max(density, 0.0) for channel in color)
    return red, green, blue


_VOLUMES: dict[str, Callable[[NodeValues], Vector]] = {
    "VOLUME_ABSORPTION": _absorbed,
    "PRINCIPLED_VOLUME": _principled_volume,
    "VOLUME_COEFFICIENTS": _coefficients,
}
"""What each volume node takes away, by the node's type."""
