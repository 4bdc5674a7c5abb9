"""Balls from legacy particle systems."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.errors import InputError
from .ball_part import BallPart, FloatArray, mean_scale, transformed_points, transformed_vectors
from .visible_sources import Source

_ALIVE = 3
"""Value of ``Particle.alive_state`` between birth and death."""


_FLUID_SECOND = 2.5
"""Fluid domains keep velocities in lengths of their longest side a unit of time, of which there are 0.1 in 1/25 second."""


def has_particle_systems(item: bpy.types.Object) -> bool:
    """Whether an object has a particle system that is not hair."""
    return any(system.settings.type != "HAIR" for system in item.particle_systems)


def read_particles(source: Source, depsgraph: bpy.types.Depsgraph, viewport: bool) -> list[BallPart]:
    """The living particles of all particle systems of a source that are not hair, one part a system.

    Parameters
    ----------
    source
        A fluid object; particles of an instance are carried to where the instance is.
    depsgraph
        The dependency graph that evaluated it.
    viewport
        Whether to read the systems that the viewport shows rather than those that a render shows.

    Raises
    ------
    InputError
        The settings ask for an attribute, which particles have not, or a system is not evaluated.
    """
    if not source.is_object_itself:
        return []
    _check_settings(source)
    systems = _shown_systems(source.object, depsgraph, viewport)
    return [_read_system(source, system, depsgraph) for system in systems]


def _check_settings(source: Source) -> None:
    settings = source.settings
    for what, mode in (("radius", settings.radius_mode), ("color", settings.color_mode)):
        if mode == "ATTRIBUTE":
            raise InputError(
                f"The particle systems of '{source.object.name}' have no attributes: "
                f"choose another {what} in its Meniscus panel, or set its source to Points"
            )


def _shown_systems(
    item: bpy.types.Object, depsgraph: bpy.types.Depsgraph, viewport: bool
) -> Iterator[bpy.types.ParticleSystem]:
    for modifier in item.modifiers:
        if modifier.type != "PARTICLE_SYSTEM" or modifier.particle_system.settings.type == "HAIR":
            continue
        if not (modifier.show_viewport if viewport else modifier.show_render):
            continue
        if depsgraph.mode == "VIEWPORT" and not viewport:
            _check_whole_in_viewport(item, modifier)
        yield modifier.particle_system


def _check_whole_in_viewport(item: bpy.types.Object, modifier: bpy.types.Modifier) -> None:
    """A render without Blender's render engines sees only what the viewport evaluates; less than a render shows is an error."""
    system = modifier.particle_system
    start = f"The particle system '{system.name}' of '{item.name}' is shown"
    if not modifier.show_viewport:
        raise InputError(f"{start} in renders only, but Blender evaluates this render in the viewport: show its modifier there")
    if system.settings.display_percentage < 100:
        raise InputError(
            f"{start} to {system.settings.display_percentage} % in the viewport, where Blender evaluates this render: "
            "set the amount of its viewport display to 100 %"
        )


def _read_system(source: Source, system: bpy.types.ParticleSystem, depsgraph: bpy.types.Depsgraph) -> BallPart:
    settings, move = source.settings, source.world_from_original
    particles = system.particles
    shown = _shown_particles(system, depsgraph)
    positions = _picked(_vectors(particles, "location"), shown)
    velocities = _picked(_vectors(particles, "velocity"), shown)
    velocities *= np.float32(_velocity_scale(source.object, system.settings, depsgraph.scene_eval.render))
    if settings.radius_mode == "FIXED":
        radii = np.full(len(positions), settings.radius, np.float32)
    else:
        radii = _picked(_numbers(particles, "size", np.float32), shown) * np.float32(settings.radius_factor)
    moves = not np.array_equal(move, np.eye(4))
    return BallPart(
        positions=transformed_points(positions, move),
        radii=radii * mean_scale(move) if moves else radii,
        weight=settings.weight,
        colors=np.array(settings.color, np.float32) if settings.color_mode == "FIXED" else None,
        velocities=transformed_vectors(velocities, move) if moves else velocities,
        ids=np.flatnonzero(shown).astype(np.int32),
    )


def _velocity_scale(item: bpy.types.Object, settings: bpy.types.ParticleSettings, render: bpy.types.RenderSettings) -> float:
    """Factor from a system's own velocities to Blender units a second."""
    domain = next((found.domain_settings for found in item.modifiers if found.type == "FLUID" and found.domain_settings), None)
    if settings.type != "EMITTER" and domain is not None:
        return _FLUID_SECOND * domain.time_scale * _longest_side(item, domain)
    # Blender simulates `timestep` (0.04 seconds) in a frame, at any frame rate.
    return settings.timestep * render.fps / render.fps_base


def _longest_side(item: bpy.types.Object, domain: bpy.types.FluidDomainSettings) -> float:
    """Of a fluid domain, Blender units in world space."""
    scale = np.linalg.norm(np.array(item.matrix_world)[:3, :3], axis=0)
    return float(np.max(np.array(domain.cell_size) * np.array(domain.domain_resolution) * scale))


def _shown_particles(system: bpy.types.ParticleSystem, depsgraph: bpy.types.Depsgraph) -> npt.NDArray[np.bool_]:
    """(N,): which particles are alive and simulated."""
    shown = _numbers(system.particles, "alive_state", np.int32) == _ALIVE
    if depsgraph.mode == "VIEWPORT" and system.settings.display_percentage < 100:
        # Blender does not simulate the others; they stay where they were born.
        shown &= _numbers(system.particles, "is_visible", np.bool_)
    return shown


def _numbers(particles: bpy.types.bpy_prop_collection, name: str, dtype: type) -> npt.NDArray:
    values = np.empty(len(particles), dtype)
    particles.foreach_get(name, values)
    return values


def _vectors(particles: bpy.types.bpy_prop_collection, name: str) -> FloatArray:
    values = np.empty(3 * len(particles), np.float32)
    particles.foreach_get(name, values)
    return values.reshape(-1, 3)


def _picked(values: npt.NDArray, shown: npt.NDArray[np.bool_]) -> npt.NDArray:
    return values if shown.all() else values[shown]
