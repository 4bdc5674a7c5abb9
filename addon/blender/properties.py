"""The settings that are saved in the .blend file: ``object.meniscus`` and ``scene.meniscus``."""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, PointerProperty, StringProperty

from ..fluid.field import Field
from ..fluid.kernels import KERNELS
from ..fluid.look import Look
from ..render.registry import method_infos

Item = tuple[str, str, str]
NumberedItem = tuple[str, str, str, int]


BACKENDS: tuple[Item, ...] = (
    ("auto", "Automatic", "The graphics card where it can, else the processor"),
    ("gpu", "GPU", "The graphics card, through OpenGL"),
    ("cpu", "CPU", "The processor"),
)


def method_items() -> list[Item]:
    """The registered methods, the automatic choice first."""
    registered = [(info.name, info.label, info.description) for info in method_infos()]
    return [("auto", "Automatic", "The fastest method that runs here"), *registered]


def stable_items(items: Iterable[Item]) -> list[NumberedItem]:
    """Enumeration items (identifier, label, description) whose numbers depend on nothing but their identifiers.

    A .blend file holds the number of an item, so that numbers by order would change their meaning with each new item.
    """
    return [(name, label, description, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, label, description in items]


class MENISCUS_PG_object(bpy.types.PropertyGroup):
    """How an object supplies balls."""

    use_fluid: BoolProperty(
        name="Use as Fluid",
        description="Draw the particles or points of this object as a blended surface",
        default=False,
    )
    source: EnumProperty(
        name="Source",
        description="What of the object supplies the balls",
        items=(
            ("AUTO", "Automatic", "The particle systems, or the points where the object has no particle system", 0),
            ("PARTICLES", "Particle Systems", "The living particles of all particle systems that are not hair", 1),
            ("POINTS", "Points", "Mesh vertices and point clouds, also those that Geometry Nodes make", 2),
        ),
        default="AUTO",
    )
    radius_mode: EnumProperty(
        name="Radius",
        description="Where the influence radius of a ball comes from",
        items=(
            ("PARTICLE", "Particle Size", "Size of the particle, or the point's attribute 'radius', times the factor", 0),
            ("ATTRIBUTE", "Attribute", "A number on each point", 1),
            ("FIXED", "Fixed", "The same radius for all", 2),
        ),
        default="PARTICLE",
    )
    radius_factor: FloatProperty(
        name="Factor",
        description="Influence radius by particle size; 4 blends those that touch, more those farther apart",
        default=4.0,
        min=0.0,
        soft_min=0.5,
        soft_max=8.0,
    )
    radius_attribute: StringProperty(
        name="Attribute",
        description="Name of the attribute on points that holds the influence radius, in the object's space",
        default="radius",
    )
    radius: FloatProperty(
        name="Radius",
        description="Influence radius of each ball, in the object's space",
        default=0.1,
        min=0.0,
        soft_min=0.001,
        subtype="DISTANCE",
        unit="LENGTH",
    )
    weight: FloatProperty(
        name="Weight",
        description="Density of each ball at its centre; negative ones carve into the others",
        default=1.0,
        soft_min=-2.0,
        soft_max=2.0,
    )
    color_mode: EnumProperty(
        name="Color",
        description="Where the colour of a ball comes from",
        items=(
            ("LOOK", "Scene", "The surface colour of the scene", 0),
            ("FIXED", "Fixed", "The same colour for all", 1),
            ("ATTRIBUTE", "Attribute", "A colour on each point", 2),
        ),
        default="LOOK",
    )
    color: FloatVectorProperty(
        name="Color",
        description="Colour of each ball, which blends between neighbours",
        default=Look().color,
        size=3,
        min=0.0,
        soft_max=1.0,
        subtype="COLOR",
    )
    color_attribute: StringProperty(
        name="Attribute",
        description="Name of the colour attribute on points",
        default="Color",
    )


class MENISCUS_PG_scene(bpy.types.PropertyGroup):
    """The surface of all the balls of a scene, and how it is drawn."""

    kernel: EnumProperty(
        name="Kernel",
        description="How the density of a ball falls from its centre to its influence radius",
        items=stable_items((kernel.name, kernel.label, kernel.description) for kernel in KERNELS.values()),
        default=Field().kernel,
    )
    isovalue: FloatProperty(
        name="Isovalue",
        description="Density at the surface; greater ones shrink the fluid",
        default=Field().isovalue,
        min=1e-6,
        soft_min=0.01,
        soft_max=1.0,
        precision=3,
    )
    method: EnumProperty(
        name="Method",
        description="How the surface is found",
        items=stable_items(method_items()),
        default="auto",
    )
    backend: EnumProperty(
        name="Device",
        description="What computes the image",
        items=stable_items(BACKENDS),
        default="auto",
    )
    color: FloatVectorProperty(
        name="Color",
        description="Surface colour of fluids that have no colour of their own",
        default=Look().color,
        size=3,
        min=0.0,
        soft_max=1.0,
        subtype="COLOR",
    )
    ambient: FloatProperty(
        name="Ambient",
        description="Share of the light that does not depend on the angle of the surface",
        default=Look().ambient,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    depth_contrast: FloatProperty(
        name="Depth Contrast",
        description="How strongly what is in front is lightened and what is behind it is darkened; 3 is a good start, 0 is off",
        default=Look().depth_contrast,
        min=0.0,
        max=100.0,
        soft_max=10.0,
    )
    depth_contrast_radius: FloatProperty(
        name="Contrast Radius",
        description="How far from the edge of what is in front the light changes, as a share of the image's height",
        default=Look().depth_contrast_radius,
        min=0.001,
        max=1.0,
        soft_max=0.2,
        precision=3,
        subtype="FACTOR",
    )


_OWNERS = ((bpy.types.Object, MENISCUS_PG_object), (bpy.types.Scene, MENISCUS_PG_scene))


def register() -> None:
    """Give objects and scenes their settings."""
    for owner, group in _OWNERS:
        bpy.utils.register_class(group)
        owner.meniscus = PointerProperty(type=group, name="Meniscus", description=group.__doc__.rstrip("."))


def unregister() -> None:
    """Take the settings away; a .blend file keeps its values."""
    for owner, group in reversed(_OWNERS):
        del owner.meniscus
        bpy.utils.unregister_class(group)
