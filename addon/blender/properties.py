"""The settings that are saved in the .blend file: ``object.meniscus``, ``mesh.meniscus`` and ``scene.meniscus``."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..fluid.displays import DISPLAYS, METABALLS
from ..fluid.field import Field
from ..fluid.kernels import KERNELS
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.passes import PASSES
from ..fluid.tracing import Tracing
from ..render.particle_settings import CELL_SHARE, COUNT, DISPERSES, FILLS_GAPS, STEPS
from ..render.registry import method_infos
from ..render.settings import Setting
from .changes import note_display, note_source

Update = Callable[[bpy.types.PropertyGroup, bpy.types.Context], None]
Item = tuple[str, str, str]
NumberedItem = tuple[str, str, str, int]


BACKENDS: tuple[Item, ...] = (
    ("auto", "Automatic", "What the fastest method runs on"),
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


_KINDS = {bool: BoolProperty, int: IntProperty, float: FloatProperty}


def setting_property(setting: Setting, update: Update | None = None) -> Any:
    """The property that holds a setting; `update` is called by Blender when it is set."""
    ends = {"min": setting.minimum, "max": setting.maximum}
    limits = {name: end for name, end in ends.items() if math.isfinite(end)}
    make = _KINDS[type(setting.default)]
    return make(name=setting.label, description=setting.description, default=setting.default, update=update, **limits)


class MENISCUS_PG_object(bpy.types.PropertyGroup):
    """How an object supplies balls."""

    use_fluid: BoolProperty(
        name="Use as Fluid",
        description="Draw the particles or points of this object as a blended surface",
        default=False,
        update=note_source,
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
        update=note_source,
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
        update=note_source,
    )
    radius_factor: FloatProperty(
        name="Factor",
        description="Influence radius by particle size; 4 blends those that touch, more those farther apart",
        default=4.0,
        min=0.0,
        soft_min=0.5,
        soft_max=8.0,
        update=note_source,
    )
    radius_attribute: StringProperty(
        name="Attribute",
        description="Name of the attribute on points that holds the influence radius, in the object's space",
        default="radius",
        update=note_source,
    )
    radius: FloatProperty(
        name="Radius",
        description="Influence radius of each ball, in the object's space",
        default=0.1,
        min=0.0,
        soft_min=0.001,
        subtype="DISTANCE",
        unit="LENGTH",
        update=note_source,
    )
    weight: FloatProperty(
        name="Weight",
        description="Density of each ball at its centre; negative ones carve into the others",
        default=1.0,
        soft_min=-2.0,
        soft_max=2.0,
        update=note_source,
    )
    color_mode: EnumProperty(
        name="Color",
        description="Where the colour of a ball comes from",
        items=(
            ("LOOK", "Scene", "The surface colour of the scene", 0),
            ("FIXED", "Fixed", "The same colour for all", 1),
            ("ATTRIBUTE", "Attribute", "A colour on each point", 2),
            ("CLUSTER", "Cluster", "A colour for each connected liquid of the scene, by its number in the pass Cluster ID", 3),
        ),
        default="LOOK",
        update=note_source,
    )
    color: FloatVectorProperty(
        name="Color",
        description="Colour of each ball, which blends between neighbours",
        default=Look().color,
        size=3,
        min=0.0,
        soft_max=1.0,
        subtype="COLOR",
        update=note_source,
    )
    color_attribute: StringProperty(
        name="Attribute",
        description="Name of the colour attribute on points",
        default="Color",
        update=note_source,
    )


def _update_particles(owner: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Have Blender evaluate a mesh, so that the handler brings its surface particles up to date."""
    owner.id_data.update_tag()


class MENISCUS_PG_mesh(bpy.types.PropertyGroup):
    """Surface particles of the scene's fluid, as the points of a mesh."""

    use_surface_particles: BoolProperty(
        name="Surface Particles",
        description="Whether the points of this mesh are the surface particles of the scene's fluid",
        default=False,
        options={"HIDDEN"},
    )
    use_live: BoolProperty(
        name="Live",
        description="Bring the particles up to date whenever the fluid or the frame changes",
        default=True,
        update=_update_particles,
    )
    particles: setting_property(COUNT, _update_particles)
    steps: setting_property(STEPS, _update_particles)
    cell_share: setting_property(CELL_SHARE, _update_particles)
    disperses: setting_property(DISPERSES, _update_particles)
    fills_gaps: setting_property(FILLS_GAPS, _update_particles)
    seed: IntProperty(
        name="Seed",
        description="Another number, another spread",
        default=0,
        min=0,
        update=_update_particles,
    )
    bake_folder: StringProperty(
        name="Folder",
        description="Where a bake writes its files, one for each frame",
        default="//surface_particles/",
        subtype="DIR_PATH",
    )
    baked_files: StringProperty(
        name="Baked Files",
        description="Which files are shown, #### is the frame number; none where the particles are live",
        options={"HIDDEN"},
        update=_update_particles,
    )
    baked_start: IntProperty(name="Start", description="First frame that is baked", options={"HIDDEN"})
    baked_end: IntProperty(name="End", description="Last frame that is baked", options={"HIDDEN"})


class MENISCUS_PG_scene(bpy.types.PropertyGroup):
    """The surface of all the balls of a scene, and how it is drawn."""

    use_viewport: BoolProperty(
        name="Show in Viewports",
        description="Draw the fluid in the 3D viewports",
        default=True,
        update=note_display,
    )
    preview_samples: IntProperty(
        name="Samples",
        description="Antialiasing of viewports at rest: how many samples a pixel gets; 1 for none",
        default=8,
        min=1,
        max=64,
        update=note_display,
    )
    preview_frame_rate: IntProperty(
        name="Frame Rate",
        description="Images a second that viewports try to hold while something moves, with fewer pixels if need be",
        default=24,
        min=1,
        max=240,
        soft_min=10,
        soft_max=60,
        update=note_display,
    )
    show_clusters: BoolProperty(
        name="Count Clusters",
        description="Find how many connected liquids the fluid has, beside each image of the viewports",
        default=False,
        update=note_display,
    )
    version: IntProperty(
        name="Version",
        description="Of the settings, see version_update.py; 0 where the file was saved before settings had versions",
        default=0,
        options={"HIDDEN"},
    )
    source_index: IntProperty(
        name="Active Source",
        description="Which of the scene's objects is chosen in the list of sources",
        default=0,
        options={"HIDDEN"},
    )
    render_samples: IntProperty(
        name="Render Samples",
        description="Antialiasing of renders: how many samples a pixel of Combined gets; data passes have one",
        default=16,
        min=1,
        max=1024,
        soft_max=64,
    )
    display: EnumProperty(
        name="Display",
        description="What the balls are shown as",
        items=stable_items((display.name, display.label, display.description) for display in DISPLAYS.values()),
        default=METABALLS,
        update=note_display,
    )
    kernel: EnumProperty(
        name="Kernel",
        description="How the density of a ball falls from its centre to its influence radius",
        items=stable_items((kernel.name, kernel.label, kernel.description) for kernel in KERNELS.values()),
        default=Field().kernel,
        update=note_display,
    )
    isovalue: FloatProperty(
        name="Isovalue",
        description="Density at the surface; greater ones shrink the fluid",
        default=Field().isovalue,
        min=1e-6,
        soft_min=0.01,
        soft_max=1.0,
        precision=3,
        update=note_display,
    )
    method: EnumProperty(
        name="Method",
        description="How the surface is found",
        items=stable_items(method_items()),
        default="auto",
        update=note_display,
    )
    backend: EnumProperty(
        name="Device",
        description="What computes the image",
        items=stable_items(BACKENDS),
        default="auto",
        update=note_display,
    )
    style: EnumProperty(
        name="Look",
        description="How the surface is coloured",
        items=stable_items((style.name, style.label, style.description) for style in LOOK_STYLES.values()),
        default=Look().style,
        update=note_display,
    )
    render_style: EnumProperty(
        name="Render Look",
        description="How the surface is coloured in renders",
        items=stable_items((style.name, style.label, style.description) for style in LOOK_STYLES.values()),
        default="material",
        update=note_display,
    )
    render_meshes: EnumProperty(
        name="Meshes",
        description="How renders show what is not fluid",
        items=(
            ("SHADED", "Shaded", "Shaded in the light of the scene; fluid hides them and is hidden by them", 0),
            (
                "HOLDOUT",
                "Holdout",
                "Not seen, but the fluid that they hide is not seen either: to be laid over another render",
                1,
            ),
            ("NONE", "Hidden", "Neither seen nor hiding fluid", 2),
        ),
        default="SHADED",
        update=note_display,
    )
    color: FloatVectorProperty(
        name="Color",
        description="Surface colour of fluids that have no colour of their own",
        default=Look().color,
        size=3,
        min=0.0,
        soft_max=1.0,
        subtype="COLOR",
        update=note_display,
    )
    ambient: FloatProperty(
        name="Ambient",
        description="Share of the light that does not depend on the angle of the surface",
        default=Look().ambient,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=note_display,
    )
    roughness: FloatProperty(
        name="Roughness",
        description="How dull the surface is: 0 is a mirror",
        default=Look().roughness,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=note_display,
    )
    metallic: FloatProperty(
        name="Metallic",
        description="1 is metal, which reflects in its own colour",
        default=Look().metallic,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=note_display,
    )
    light: FloatVectorProperty(
        name="Light",
        description="Where the key light comes from: x to the right, y up, z towards the viewer",
        default=Look().light,
        size=3,
        subtype="DIRECTION",
        update=note_display,
    )
    light_strength: FloatProperty(
        name="Strength",
        description="Factor of all light",
        default=Look().light_strength,
        min=0.0,
        soft_max=4.0,
        update=note_display,
    )
    absorption: FloatProperty(
        name="Absorption",
        description="How much light each Blender unit of clear fluid takes away, most of the colours that its colour lacks",
        default=Look().absorption,
        min=0.0,
        soft_max=20.0,
        update=note_display,
    )
    transmission: FloatProperty(
        name="Transmission",
        description="Share of the light that passes through the surface of fluid without a material, where materials are shown",
        default=0.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=note_display,
    )
    use_tracing: BoolProperty(
        name="Ray Tracing",
        description="Follow light beyond the first surface, where materials are shown: shadows, reflections, refraction",
        default=False,
        update=note_display,
    )
    use_preview_tracing: BoolProperty(
        name="Ray Tracing",
        description="Trace light in viewports too, where they show materials and ray tracing is on",
        default=True,
        update=note_display,
    )
    tracing_reflections: IntProperty(
        name="Reflections",
        description="How many mirrors light may meet; after the last one they mirror the world alone",
        default=Tracing().reflections,
        min=0,
        max=64,
        soft_max=16,
        update=note_display,
    )
    tracing_refractions: IntProperty(
        name="Refractions",
        description="How many surfaces light may pass; a drop of water has two, after the last one the world is seen",
        default=Tracing().refractions,
        min=0,
        max=64,
        soft_max=32,
        update=note_display,
    )
    use_tracing_shadows: BoolProperty(
        name="Shadows",
        description="Let what stands before a light take it away",
        default=Tracing().shadows,
        update=note_display,
    )
    use_tracing_occlusion: BoolProperty(
        name="Ambient Occlusion",
        description="Let what is near take the light of the world away",
        default=False,
        update=note_display,
    )
    tracing_occlusion_rays: IntProperty(
        name="Rays",
        description="How many rays of each sample ask how much of the world a point sees",
        default=8,
        min=1,
        max=4096,
        soft_max=64,
        update=note_display,
    )
    tracing_occlusion_distance: FloatProperty(
        name="Distance",
        description="How far these rays look; what is farther takes no light away. 0 for no limit",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
        unit="LENGTH",
        update=note_display,
    )
    tracing_samples: IntProperty(
        name="Light Samples",
        description="How often light is traced for each sample of a pixel: more lessens the noise of soft shadows and gloss",
        default=Tracing().samples,
        min=1,
        max=65536,
        soft_max=64,
        update=note_display,
    )
    ior: FloatProperty(
        name="IOR",
        description="Index of refraction: 1.33 is water, 1 bends nothing",
        default=Look().ior,
        min=1.0,
        max=3.0,
        precision=3,
        update=note_display,
    )
    use_speed_range: BoolProperty(
        name="Fixed Range",
        description="Give the speeds at the ends of the colour map instead of 0 and the speed of the fastest ball",
        default=False,
        update=note_display,
    )
    speed_min: FloatProperty(
        name="Slow",
        description="Speed at the lower end of the colour map",
        default=0.0,
        min=0.0,
        unit="VELOCITY",
        update=note_display,
    )
    speed_max: FloatProperty(
        name="Fast",
        description="Speed at the upper end of the colour map",
        default=5.0,
        min=0.0,
        unit="VELOCITY",
        update=note_display,
    )
    depth_contrast: FloatProperty(
        name="Depth Contrast",
        description="How strongly what is in front is lightened and what is behind it is darkened; 3 is a good start, 0 is off",
        default=Look().depth_contrast,
        min=0.0,
        max=100.0,
        soft_max=10.0,
        update=note_display,
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
        update=note_display,
    )


class MENISCUS_PG_view_layer(bpy.types.PropertyGroup):
    """The passes that Blender's own view layers have no switch for."""

    use_pass_alpha: BoolProperty(name="Alpha", description=PASSES["alpha"].description)
    use_pass_facing: BoolProperty(name="Facing", description=PASSES["facing"].description)
    use_pass_thickness: BoolProperty(name="Thickness", description=PASSES["thickness"].description)
    use_pass_color: BoolProperty(name="Color", description=PASSES["color"].description)
    use_pass_velocity: BoolProperty(name="Velocity", description=PASSES["velocity"].description)
    use_pass_speed: BoolProperty(name="Speed", description=PASSES["speed"].description)
    use_pass_ball_id: BoolProperty(name="Ball ID", description=PASSES["ball_id"].description)
    use_pass_cluster_id: BoolProperty(name="Cluster ID", description=PASSES["cluster_id"].description)


_OWNERS = (
    (bpy.types.Object, MENISCUS_PG_object),
    (bpy.types.Mesh, MENISCUS_PG_mesh),
    (bpy.types.Scene, MENISCUS_PG_scene),
    (bpy.types.ViewLayer, MENISCUS_PG_view_layer),
)


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
