"""The panels: in the sidebar of the 3D viewport, and in the properties editor."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import ClassVar

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..fluid.image import RenderInfo
from ..fluid.look import LOOK_STYLES
from ..fluid.passes import PASSES
from ..render.particle_settings import SIMULATION_SETTINGS
from .compositing import fluid_scene_of
from .engine_name import ENGINE
from .method_settings import group_of
from .particle_operators import active_particles
from .presets import PRESETS
from .sources import active_source, has_sources, source_flags
from .surface_particles import CLOUDS
from .texture_sharing import SHARING
from .version_update import CURRENT_VERSION
from .view_layer_passes import BLENDER_SWITCHES
from .viewport_status import STATUS

_CLOSED: ClassVar = {"DEFAULT_CLOSED"}

# Which of the look's settings a style has a use for, in the order of the panel.
_LOOK_SETTINGS: dict[str, tuple[str, ...]] = {
    "studio": ("color", "ambient", "roughness", "metallic", "light", "light_strength"),
    "water": ("color", "absorption", "ior", "roughness", "light", "light_strength"),
    "material": ("color", "metallic", "roughness", "transmission", "absorption", "ior"),
    "headlight": ("color", "ambient"),
    "flat": ("color",),
    "normal": (),
    "depth": (),
    "speed": (),
    "id": (),
}

_STAGES_SHOWN = 8


class MENISCUS_UL_sources(bpy.types.UIList):
    """The objects of the scene that are used as fluid"""

    bl_idname = "MENISCUS_UL_sources"

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property) -> None:
        is_emitter = len(item.particle_systems) > 0
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="PARTICLES" if is_emitter else "POINTCLOUD_DATA")
        row.prop(item, "hide_viewport", text="", emboss=False, icon_only=True)

    def draw_filter(self, _context, layout) -> None:
        # No button to invert: Blender inverts what is filtered in some versions only, and would show what is no source.
        row = layout.row(align=True)
        row.prop(self, "filter_name", text="", icon="VIEWZOOM")
        row.prop(self, "use_filter_sort_alpha", text="", icon="SORTALPHA")

    def filter_items(self, _context, data, name) -> tuple[list[int], list[int]]:
        objects, flags, helper = getattr(data, name), source_flags(data), bpy.types.UI_UL_list
        found = [self.bitflag_filter_item] * len(flags)
        if self.filter_name:
            found = helper.filter_items_by_name(self.filter_name, self.bitflag_filter_item, objects, "name")
        order = helper.sort_items_by_name(objects, "name") if self.use_filter_sort_alpha else []
        return [bit if flag else 0 for bit, flag in zip(found, flags, strict=True)], order


class MENISCUS_PT_presets(PresetPanel, bpy.types.Panel):
    """Looks that come with Meniscus, and the user's own, which can be added and removed."""

    bl_label = "Presets"
    preset_subdir = "meniscus"
    preset_operator = "script.execute_preset"
    preset_add_operator = "meniscus.add_preset"

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.emboss = "PULLDOWN_MENU"
        for name, preset in PRESETS.items():
            column.operator("meniscus.apply_preset", text=preset.label).preset = name
        self.layout.separator()
        if bpy.utils.preset_paths(self.preset_subdir):
            super().draw(context)
        else:  # before the first of the user's own there is no folder, and Blender would complain of that
            row = self.layout.row(align=True)
            row.prop(context.window_manager, "preset_name", text="")
            row.operator(self.preset_add_operator, text="", icon="ADD").name = context.window_manager.preset_name


class MENISCUS_OT_add_preset(AddPresetBase, bpy.types.Operator):
    """Keep the scene's kernel, isovalue and look under a name of your own, or remove what was kept"""

    bl_idname = "meniscus.add_preset"
    bl_label = "Add Preset"
    preset_menu = "MENISCUS_PT_presets"
    preset_subdir = "meniscus"
    preset_values: ClassVar = [
        f"bpy.context.scene.meniscus.{name}"
        for name in (
            *("kernel", "isovalue", "style", "color", "ambient", "roughness", "metallic", "light", "light_strength"),
            *("absorption", "ior", "use_speed_range", "speed_min", "speed_max", "depth_contrast", "depth_contrast_radius"),
            *("render_style", "transmission", "use_tracing", "tracing_reflections", "tracing_refractions", "tracing_samples"),
            *("use_tracing_shadows", "use_tracing_occlusion", "tracing_occlusion_rays", "tracing_occlusion_distance"),
        )
    ]


class _SidebarPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Meniscus"


class MENISCUS_PT_sidebar(_SidebarPanel, bpy.types.Panel):
    """Switch, problem and sources."""

    bl_label = "Meniscus"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.meniscus, "use_viewport", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        _draw_problem(layout)
        if scene.meniscus.version > CURRENT_VERSION:
            _draw_text(layout, "This file was saved by a newer Meniscus: settings that this one lacks are not shown.", "INFO")
        if not has_sources(scene):
            layout.label(text="Select an object with particles or points.")
            button = layout.column()
            button.scale_y = 1.5
            button.operator("meniscus.add_sources", icon="MOD_FLUIDSIM")
            return
        row = layout.row()
        row.template_list("MENISCUS_UL_sources", "", scene, "objects", scene.meniscus, "source_index", rows=3)
        buttons = row.column(align=True)
        buttons.operator("meniscus.add_sources", text="", icon="ADD")
        buttons.operator("meniscus.remove_source", text="", icon="REMOVE")
        buttons.separator()
        buttons.operator("meniscus.select_source", text="", icon="RESTRICT_SELECT_OFF")


class MENISCUS_PT_sidebar_source(_SidebarPanel, bpy.types.Panel):
    """Settings of the source that is chosen in the list."""

    bl_label = "Source"
    bl_parent_id = "MENISCUS_PT_sidebar"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_sources(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        source = active_source(context.scene)
        if source is not None:
            _draw_source(self.layout, source.meniscus)


class MENISCUS_PT_sidebar_look(_SidebarPanel, bpy.types.Panel):
    """Colour and light."""

    bl_label = "Look"
    bl_parent_id = "MENISCUS_PT_sidebar"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        MENISCUS_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        _draw_look(self.layout, context.scene.meniscus)


class _TracingPanel:
    """How far light is followed."""

    bl_label = "Ray Tracing"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.meniscus, "use_tracing", text="")

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.active = context.scene.meniscus.use_tracing
        _draw_tracing(_split(self.layout), context.scene.meniscus)


class MENISCUS_PT_sidebar_tracing(_SidebarPanel, _TracingPanel, bpy.types.Panel):
    """The same for viewports that show materials."""

    bl_parent_id = "MENISCUS_PT_sidebar"
    bl_options: ClassVar[set[str]] = _CLOSED

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return LOOK_STYLES[context.scene.meniscus.style].uses_scene


class MENISCUS_PT_sidebar_surface(_SidebarPanel, bpy.types.Panel):
    """What the surface is, and how it is found."""

    bl_label = "Surface"
    bl_parent_id = "MENISCUS_PT_sidebar"
    bl_options: ClassVar[set[str]] = _CLOSED

    def draw(self, context: bpy.types.Context) -> None:
        _draw_surface(self.layout, context.scene.meniscus)


class MENISCUS_PT_sidebar_quality(_SidebarPanel, bpy.types.Panel):
    """How fine, and how fast."""

    bl_label = "Viewport Quality"
    bl_parent_id = "MENISCUS_PT_sidebar"
    bl_options: ClassVar[set[str]] = _CLOSED

    def draw(self, context: bpy.types.Context) -> None:
        layout = _split(self.layout)
        layout.prop(context.scene.meniscus, "preview_samples")
        layout.prop(context.scene.meniscus, "preview_frame_rate")
        layout.prop(context.scene.meniscus, "use_preview_tracing")


class MENISCUS_PT_sidebar_particles(_SidebarPanel, bpy.types.Panel):
    """Points on the surface, as data."""

    bl_label = "Surface Particles"
    bl_parent_id = "MENISCUS_PT_sidebar"
    bl_options: ClassVar[set[str]] = _CLOSED

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_sources(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        mesh = active_particles(context)
        if mesh is None:
            self.layout.operator("meniscus.surface_particles_add", icon="POINTCLOUD_DATA")
        else:
            _draw_particles(self.layout, context.scene, mesh)


class MENISCUS_PT_sidebar_statistics(_SidebarPanel, bpy.types.Panel):
    """How the newest image of a viewport came about."""

    bl_label = "Statistics"
    bl_parent_id = "MENISCUS_PT_sidebar"
    bl_options: ClassVar[set[str]] = _CLOSED

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.meniscus, "show_clusters")
        if STATUS.info is None:
            self.layout.label(text="Nothing has been drawn yet.")
        else:
            _draw_statistics(self.layout, STATUS.info)


class _PropertiesPanel:
    bl_label = "Meniscus"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options: ClassVar[set[str]] = _CLOSED


class _FluidPanel(_PropertiesPanel):
    """The settings of an object that supplies balls."""

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.object.meniscus, "use_fluid", text="")

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.active = context.object.meniscus.use_fluid
        _draw_source(self.layout, context.object.meniscus)


class MENISCUS_PT_object(_FluidPanel, bpy.types.Panel):
    """Fluid settings beside the other settings of the object."""

    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and active_particles(context) is None


class MENISCUS_PT_particles(_FluidPanel, bpy.types.Panel):
    """The same settings beside those of the particle systems."""

    bl_context = "particle"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and len(context.object.particle_systems) > 0


class MENISCUS_PT_data(_FluidPanel, bpy.types.Panel):
    """The same settings beside those of the object's points."""

    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_points = context.object is not None and context.object.type in ("MESH", "POINTCLOUD", "CURVES", "CURVE")
        return has_points and active_particles(context) is None


class MENISCUS_PT_particle_data(_PropertiesPanel, bpy.types.Panel):
    """Surface particles beside the other settings of their mesh."""

    bl_label = "Surface Particles"
    bl_context = "data"
    bl_options: ClassVar[set[str]] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_particles(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        _draw_particles(self.layout, context.scene, active_particles(context))


class MENISCUS_PT_scene(_PropertiesPanel, bpy.types.Panel):
    """The surface of all fluids in the scene."""

    bl_context = "render"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        MENISCUS_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        _draw_surface(self.layout, context.scene.meniscus)
        self.layout.separator()
        _draw_look(self.layout, context.scene.meniscus)


class _EnginePanel(_PropertiesPanel):
    """What holds for the render engine."""

    bl_options: ClassVar[set[str]] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine == ENGINE


class _OtherEnginePanel(_PropertiesPanel):
    """What can be had of the fluid where another engine renders."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine != ENGINE and has_sources(context.scene)


class MENISCUS_PT_compositing(_OtherEnginePanel, bpy.types.Panel):
    """The fluid over what another engine renders."""

    bl_label = "Meniscus Compositing"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        fluid = fluid_scene_of(context.scene)
        if fluid is None:
            self.layout.operator_menu_enum("meniscus.add_compositing", "merge", icon="NODE_COMPOSITING")
        else:
            _draw_text(self.layout, f"The compositor lays the fluid of '{fluid.name}' over this scene.", "CHECKMARK")


class MENISCUS_PT_sampling(_EnginePanel, bpy.types.Panel):
    """Antialiasing of the render engine."""

    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        _split(self.layout).prop(context.scene.meniscus, "render_samples", text="Render")


class MENISCUS_PT_render_look(_EnginePanel, bpy.types.Panel):
    """How renders colour the fluid."""

    bl_label = "Fluid"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        layout = _split(self.layout)
        settings = context.scene.meniscus
        layout.prop(settings, "render_style", text="Look")
        layout.prop(settings, "render_meshes")
        if LOOK_STYLES[settings.render_style].uses_scene:
            layout.label(text="Sources without a material:")
            for name in _LOOK_SETTINGS["material"]:
                layout.prop(settings, name)


class MENISCUS_PT_tracing(_EnginePanel, _TracingPanel, bpy.types.Panel):
    """Traced light of the render engine."""

    bl_context = "render"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and LOOK_STYLES[context.scene.meniscus.render_style].uses_scene


class _PassesPanel(_PropertiesPanel):
    """The passes of a view layer."""

    bl_context = "view_layer"

    def draw(self, context: bpy.types.Context) -> None:
        layout, view_layer = _split(self.layout), context.view_layer
        layout.use_property_decorate = False
        column = layout.column(heading="Data")
        for image_pass in PASSES.values():
            switch = BLENDER_SWITCHES.get(image_pass.name)
            if switch is not None:
                column.prop(view_layer, switch, text=image_pass.blender_name)
            elif image_pass.name != "combined":
                column.prop(view_layer.meniscus, f"use_pass_{image_pass.name}")
        column = layout.column(heading="Cryptomatte")
        column.prop(view_layer, "use_pass_cryptomatte_object", text="Object")
        levels = column.column()
        levels.active = view_layer.use_pass_cryptomatte_object
        levels.prop(view_layer, "pass_cryptomatte_depth", text="Levels")
        self.layout.operator("meniscus.export_passes", icon="EXPORT")


class MENISCUS_PT_passes(_EnginePanel, _PassesPanel, bpy.types.Panel):
    """What the render engine gives beside Combined."""

    bl_label = "Passes"


class MENISCUS_PT_fluid_passes(_OtherEnginePanel, _PassesPanel, bpy.types.Panel):
    """What the export writes of a scene that another engine renders."""

    bl_label = "Fluid Passes"


def _split(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Names to the left, values to the right, with dots to animate them."""
    layout.use_property_split = True
    layout.use_property_decorate = True
    return layout


def _draw_source(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout = _split(layout)
    layout.prop(settings, "source")
    _draw_radius(layout.column(), settings)
    layout.prop(settings, "weight")
    _draw_color(layout.column(), settings)


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


def _draw_surface(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout = _split(layout)
    for name in ("display", "kernel", "isovalue", "method"):
        layout.prop(settings, name)
    group = group_of(settings, settings.method)
    if group is not None:
        for name in group.__annotations__:
            layout.prop(group, name)
    layout.prop(settings, "backend")


def _draw_look(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout = _split(layout)
    layout.prop(settings, "style")
    for name in _LOOK_SETTINGS[settings.style]:
        layout.prop(settings, name)
    if settings.style == "speed":
        layout.prop(settings, "use_speed_range")
        ends = layout.column(align=True)
        ends.active = settings.use_speed_range
        ends.prop(settings, "speed_min")
        ends.prop(settings, "speed_max")
    if LOOK_STYLES[settings.style].is_lit:
        layout.prop(settings, "depth_contrast")
        radius = layout.column()
        radius.active = settings.depth_contrast > 0
        radius.prop(settings, "depth_contrast_radius")


def _draw_tracing(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    for name in ("tracing_samples", "tracing_reflections", "tracing_refractions", "use_tracing_shadows"):
        layout.prop(settings, name)
    layout.prop(settings, "use_tracing_occlusion")
    occlusion = layout.column(align=True)
    occlusion.active = settings.use_tracing_occlusion
    occlusion.prop(settings, "tracing_occlusion_rays")
    occlusion.prop(settings, "tracing_occlusion_distance")


def _draw_particles(layout: bpy.types.UILayout, scene: bpy.types.Scene, mesh: bpy.types.Mesh) -> None:
    settings = mesh.meniscus
    if problem := CLOUDS.problem_of(mesh):
        _draw_text(layout, problem, "ERROR")
    live = _split(layout).column()
    live.enabled = not settings.baked_files
    for name in ("use_live", *(setting.name for setting in SIMULATION_SETTINGS), "seed", "bake_folder"):
        live.prop(settings, name)
    if settings.baked_files:
        layout.label(text=f"Frames {settings.baked_start} to {settings.baked_end} are baked.", icon="CHECKMARK")
        layout.operator("meniscus.surface_particles_free")
    else:
        layout.operator("meniscus.surface_particles_bake", text="Bake")
    if not scene.render.use_lock_interface:
        _draw_text(layout, "Renders change the particles: lock the interface, or Blender may crash.", "ERROR")
        layout.prop(scene.render, "use_lock_interface")


def _draw_problem(layout: bpy.types.UILayout) -> None:
    if STATUS.problem:
        box = layout.box()
        _draw_text(box, STATUS.problem, "ERROR")
        box.operator("meniscus.copy_problem", icon="COPYDOWN")


def _draw_text(layout: bpy.types.UILayout, text: str, icon: str) -> None:
    """A sentence over as many lines as the width of the sidebar needs; labels do not wrap."""
    width = bpy.context.region.width if bpy.context.region else 280
    letters = max(20, int(width / (7 * bpy.context.preferences.system.ui_scale)) - 6)
    column = layout.column(align=True)
    for number, line in enumerate(wrap(text, letters)):
        column.label(text=line, icon=icon if number == 0 else "BLANK1")


def _draw_statistics(layout: bpy.types.UILayout, info: RenderInfo) -> None:
    lines = [
        ("Method", info.method.replace("_", " ").title()),
        ("Device", info.device),
        ("Balls", f"{info.counts.get('balls', 0):,}"),
    ]
    if "balls_drawn" in info.counts:
        lines.append(("Drawn", f"{info.counts['balls_drawn']:,}"))
    if "glyphs" in info.counts:
        lines.append(("Glyphs", f"{info.counts['glyphs']:,}"))
    lines += cluster_lines(info.counts)
    if info.counts.get("unfinished"):
        lines.append(("Unfinished", f"{info.counts['unfinished']:,} pixels"))
    lines += [
        (stage.replace("_", " ").title(), f"{time:.1f} ms") for stage, time in list(info.milliseconds.items())[:_STAGES_SHOWN]
    ]
    names, values = _columns(layout)
    for name, value in lines:
        names.label(text=name)
        values.label(text=value)
    _draw_text(layout, f"{info.reason}.", "INFO")
    for note in STATUS.notes:
        _draw_text(layout, note, "ERROR")
    if SHARING.problem and info.backend == "gpu":
        _draw_text(layout, f"{SHARING.problem}.", "INFO")


def cluster_lines(counts: Mapping[str, int]) -> list[tuple[str, str]]:
    """Names and values of what is known of clusters; nothing where they were not asked for."""
    if "clusters" not in counts:
        return []
    largest = counts["largest_cluster"]
    share = largest / max(counts["balls"], 1)
    return [
        ("Clusters", f"{counts['clusters']:,}"),
        ("Largest", f"{largest:,} balls, {share:.1%}"),
        ("Lone Droplets", f"{counts['lone_droplets']:,}"),
    ]


def _columns(layout: bpy.types.UILayout) -> tuple[bpy.types.UILayout, bpy.types.UILayout]:
    split = layout.split(factor=0.35)
    names = split.column(align=True)
    names.alignment = "RIGHT"
    return names, split.column(align=True)


_CLASSES = (
    MENISCUS_UL_sources,
    MENISCUS_PT_presets,
    MENISCUS_OT_add_preset,
    MENISCUS_PT_sidebar,
    MENISCUS_PT_sidebar_source,
    MENISCUS_PT_sidebar_look,
    MENISCUS_PT_sidebar_tracing,
    MENISCUS_PT_sidebar_surface,
    MENISCUS_PT_sidebar_quality,
    MENISCUS_PT_sidebar_particles,
    MENISCUS_PT_sidebar_statistics,
    MENISCUS_PT_object,
    MENISCUS_PT_particles,
    MENISCUS_PT_data,
    MENISCUS_PT_particle_data,
    MENISCUS_PT_scene,
    MENISCUS_PT_compositing,
    MENISCUS_PT_sampling,
    MENISCUS_PT_render_look,
    MENISCUS_PT_tracing,
    MENISCUS_PT_passes,
    MENISCUS_PT_fluid_passes,
)


def register() -> None:
    """Show the panels."""
    for panel in _CLASSES:
        bpy.utils.register_class(panel)


def unregister() -> None:
    """Remove the panels."""
    for panel in reversed(_CLASSES):
        bpy.utils.unregister_class(panel)
