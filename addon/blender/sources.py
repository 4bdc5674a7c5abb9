"""The objects of a scene that are used as fluid, and how to make them so."""

from __future__ import annotations

import bpy

from .changes import CHANGES
from .particle_mesh import has_surface_particles
from .read_particles import has_particle_systems

HIDDEN_DISPLAY = "meniscus_display_method"
"""Custom property of particle settings: how Blender drew the particles before the fluid took their place."""

_cache: dict[int, tuple[int, int, list[bool]]] = {}


def source_flags(scene: bpy.types.Scene) -> list[bool]:
    """Which of ``scene.objects`` are used as fluid. Looks anew only where some may have come or gone."""
    key = scene.as_pointer()
    count, revision = len(scene.objects), CHANGES.structure
    if key not in _cache or _cache[key][:2] != (count, revision):
        _cache.clear()
        _cache[key] = count, revision, [item.meniscus.use_fluid for item in scene.objects]
    return _cache[key][2]


def has_sources(scene: bpy.types.Scene) -> bool:
    """Whether any object of a scene is used as fluid."""
    return any(source_flags(scene))


def active_source(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The source that is chosen in the list, else the first; None where there is none."""
    flags = source_flags(scene)
    index = scene.meniscus.source_index
    if not (0 <= index < len(flags) and flags[index]):
        if True not in flags:
            return None
        index = flags.index(True)
    return scene.objects[index]


def problem_of(item: bpy.types.Object) -> str:
    """Why an object cannot become a source by itself, as the end of a sentence; empty where it can."""
    if item.library is not None:
        return "is linked: make a library override of it"
    if has_surface_particles(item.data):
        return "shows the surface particles of the fluid, and cannot be fluid itself"
    if has_particle_systems(item):
        return ""
    if item.type == "POINTCLOUD" or any(modifier.type == "NODES" for modifier in item.modifiers):
        return ""
    if item.type == "MESH" and len(item.data.vertices) > 0 and len(item.data.polygons) == 0:
        return ""
    return "has no particles or points: add a particle system or Geometry Nodes points"


def use_as_fluid(item: bpy.types.Object) -> None:
    """Make an object a source; Blender no longer draws its particles as dots over the fluid."""
    item.meniscus.use_fluid = True
    for settings in _particle_settings(item):
        if settings.display_method != "NONE":
            settings[HIDDEN_DISPLAY] = settings.display_method
            settings.display_method = "NONE"


def use_no_more(item: bpy.types.Object) -> None:
    """Undo :func:`use_as_fluid`; particle settings that another source shares stay as they are."""
    item.meniscus.use_fluid = False
    for settings in _particle_settings(item):
        if HIDDEN_DISPLAY in settings and not _is_of_source(settings):
            if settings.display_method == "NONE":  # else the user has chosen another since
                settings.display_method = settings[HIDDEN_DISPLAY]
            del settings[HIDDEN_DISPLAY]


def _is_of_source(settings: bpy.types.ParticleSettings) -> bool:
    users = bpy.data.user_map(subset=[settings])[settings]
    return any(isinstance(user, bpy.types.Object) and user.meniscus.use_fluid for user in users)


def _particle_settings(item: bpy.types.Object) -> list[bpy.types.ParticleSettings]:
    found = [system.settings for system in item.particle_systems if system.settings.type != "HAIR"]
    return [settings for settings in found if settings.library is None]
