"""The panels in the properties editor."""

from __future__ import annotations

from typing import ClassVar

import bpy


class _FluidPanel:
    """The settings of an object that supplies balls."""

    bl_label = "Meniscus"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.object.meniscus, "use_fluid", text="")

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.object.meniscus
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        layout.active = settings.use_fluid
        layout.prop(settings, "source")
        _draw_radius(layout.column(), settings)
        layout.prop(settings, "weight")
        _draw_color(layout.column(), settings)


class MENISCUS_PT_object(_FluidPanel, bpy.types.Panel):
    """Fluid settings beside the other settings of the object."""

    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None


class MENISCUS_PT_particles(_FluidPanel, bpy.types.Panel):
    """The same settings beside those of the particle systems."""

    bl_context = "particle"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and len(context.object.particle_systems) > 0


class MENISCUS_PT_scene(bpy.types.Panel):
    """The surface of all fluids in the scene."""

    bl_label = "Meniscus"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.meniscus
        layout = self.layout
        layout.use_property_split = True
        layout.prop(settings, "kernel")
        layout.prop(settings, "isovalue")
        layout.prop(settings, "method")
        layout.prop(settings, "backend")
        layout.prop(settings, "color")
        layout.prop(settings, "ambient")
        layout.prop(settings, "depth_contrast")
        radius = layout.column()
        radius.active = settings.depth_contrast > 0
        radius.prop(settings, "depth_contrast_radius")


def _draw_radius(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "radius_mode")
    if settings.radius_mode == "PARTICLE":
        layout.prop(settings, "radius_factor")
    elif settings.radius_mode == "ATTRIBUTE":
        layout.prop(settings, "radius_attribute")
    else:
        layout.prop(settings, "radius", text="Distance")


def _draw_color(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.prop(settings, "color_mode")
    if settings.color_mode == "FIXED":
        layout.prop(settings, "color", text="Fixed Color")
    elif settings.color_mode == "ATTRIBUTE":
        layout.prop(settings, "color_attribute")


_CLASSES = (MENISCUS_PT_object, MENISCUS_PT_particles, MENISCUS_PT_scene)


def register() -> None:
    """Show the panels."""
    for panel in _CLASSES:
        bpy.utils.register_class(panel)


def unregister() -> None:
    """Remove the panels."""
    for panel in reversed(_CLASSES):
        bpy.utils.unregister_class(panel)
