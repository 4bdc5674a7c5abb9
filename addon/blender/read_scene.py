"""The balls, the field and the look of a Blender scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.errors import InputError
from ..fluid.field import Field
from ..fluid.lighting import FluidSource
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.tracing import Tracing
from .ball_part import BallPart
from .read_materials import read_source
from .read_particles import has_particle_systems, read_particles
from .read_points import read_points
from .visible_sources import Source, settings_of, visible_sources


def cluster_sources(sources: Sequence[FluidSource]) -> tuple[int, ...]:
    """Indices of the sources whose balls take the colours of clusters."""
    return tuple(index for index, source in enumerate(sources) if source.has_cluster_colors)


@dataclass(frozen=True)
class Fluid:
    """All balls of a scene, the objects that they come from by :attr:`Balls.sources`, and what the reader has noted."""

    balls: Balls
    sources: tuple[FluidSource, ...]
    notes: tuple[str, ...] = ()

    @property
    def cluster_sources(self) -> tuple[int, ...]:
        """Whose balls are to be coloured by :func:`cluster_numbers.colored_by_cluster`."""
        return cluster_sources(self.sources)


@dataclass(frozen=True)
class FluidParts:
    """The balls of a scene, source by source, and the objects that they come from by :attr:`BallPart.source`."""

    parts: tuple[BallPart, ...]
    sources: tuple[FluidSource, ...]
    scene_color: tuple[float, float, float]

    def joined(self) -> Fluid:
        """All together. What will be coloured by clusters has the scene's colour so far."""
        chosen = cluster_sources(self.sources)
        parts = [replace(part, colors=self.scene_color) if part.source in chosen else part for part in self.parts]
        return Fluid(_joined(parts, self.scene_color), self.sources)


def read_fluid(
    depsgraph: bpy.types.Depsgraph,
    *,
    viewport: bool = False,
    space: bpy.types.SpaceView3D | None = None,
    uses_materials: bool = False,
) -> Fluid:
    """All balls of a scene at its current frame, in world space.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph. One that was made for the viewport holds only what the viewport evaluates.
    viewport
        Whether to read what the viewport shows rather than what a render shows.
    space
        The viewport whose local view counts; None for none.
    uses_materials
        Whether materials are read, and balls without colours of their own get that of their material, not that of the scene.

    Returns
    -------
    Fluid
        Of all sources together; none where the sources are hidden or have no particle at this frame. Ids are there where
        a single source has them, because those of several would clash.

    Raises
    ------
    NoSourceError
        No object is used as fluid.
    InputError
        One lacks what its settings ask for.
    """
    return read_parts(depsgraph, viewport=viewport, space=space, uses_materials=uses_materials).joined()


def read_parts(
    depsgraph: bpy.types.Depsgraph,
    *,
    viewport: bool = False,
    space: bpy.types.SpaceView3D | None = None,
    uses_materials: bool = False,
) -> FluidParts:
    """The same, source by source; the parameters and the errors are those of :func:`read_fluid`."""
    parts: list[BallPart] = []
    indices: dict[str, int] = {}
    objects: list[FluidSource] = []
    settings = settings_of(depsgraph.scene_eval, depsgraph)
    for source in visible_sources(depsgraph, viewport, space):
        index = indices.setdefault(source.object.name_full, len(objects))
        if index == len(objects):
            objects.append(read_source(source.object, depsgraph.view_layer, settings, uses_materials))
        own_color = objects[index].material.color if uses_materials else None
        parts += [
            replace(part, source=index, colors=own_color if part.colors is None else part.colors)
            for part in _parts_of(source, depsgraph, viewport)
        ]
    return FluidParts(tuple(part for part in parts if len(part)), tuple(objects), tuple(settings.color))


def read_field(scene: bpy.types.Scene) -> Field:
    """The density field that the scene's settings describe."""
    return Field(kernel=scene.meniscus.kernel, isovalue=scene.meniscus.isovalue)


def frame_seconds(scene: bpy.types.Scene) -> float:
    """How long a frame is shown."""
    return float(scene.render.fps_base / scene.render.fps)


def scene_seconds(scene: bpy.types.Scene) -> float:
    """The time by the clock of the scene."""
    return (scene.frame_current + scene.frame_subframe) * frame_seconds(scene)


def read_look(scene: bpy.types.Scene, style: str, choices: Mapping[str, Any] | None = None) -> Look:
    """The colour and light that the scene's settings describe, in one of the :data:`look.LOOK_STYLES`.

    `choices` are for :func:`read_tracing`.
    """
    settings = scene.meniscus
    return Look(
        style=style,
        color=tuple(settings.color),
        ambient=settings.ambient,
        roughness=settings.roughness,
        metallic=settings.metallic,
        light=tuple(settings.light),
        light_strength=settings.light_strength,
        absorption=settings.absorption,
        ior=settings.ior,
        speed_range=(settings.speed_min, settings.speed_max) if settings.use_speed_range else None,
        depth_contrast=settings.depth_contrast,
        depth_contrast_radius=settings.depth_contrast_radius,
        tracing=read_tracing(scene, choices or {}) if LOOK_STYLES[style].uses_scene else None,
    )


def read_tracing(scene: bpy.types.Scene, choices: Mapping[str, Any]) -> Tracing | None:
    """How far the scene's settings have light followed; None where they do not.

    Parameters
    ----------
    choices
        What counts in place of the settings: attributes of :class:`tracing.Tracing`, and ``use_tracing``. None counts for
        nothing.

    Raises
    ------
    InputError
        A number is out of range.
    """
    settings = scene.meniscus
    given = {name: choice for name, choice in choices.items() if choice is not None}
    if not given.pop("use_tracing", settings.use_tracing):
        return None
    own = {
        "reflections": settings.tracing_reflections,
        "refractions": settings.tracing_refractions,
        "shadows": settings.use_tracing_shadows,
        "occlusion_rays": settings.tracing_occlusion_rays if settings.use_tracing_occlusion else 0,
        "occlusion_distance": settings.tracing_occlusion_distance or math.inf,
        "samples": settings.tracing_samples,
    }
    return Tracing(**{**own, **given})


def _parts_of(source: Source, depsgraph: bpy.types.Depsgraph, viewport: bool) -> list[BallPart]:
    choice = source.settings.source
    if choice == "PARTICLES" and not has_particle_systems(source.object):
        raise InputError(f"'{source.object.name}' has no particle system: add one, or set its fluid source to Points")
    if choice == "PARTICLES" or (choice == "AUTO" and has_particle_systems(source.object)):
        return read_particles(source, depsgraph, viewport)
    return read_points(source, depsgraph)


def _joined(parts: Sequence[BallPart], scene_color: tuple[float, float, float]) -> Balls:
    """All parts as one; what only some of them have is filled with what holds for the others."""
    if not parts:
        return Balls(np.empty((0, 3), np.float32), np.empty(0, np.float32))
    return Balls(
        positions=_concatenated(parts, lambda part: part.positions, (3,)),
        radii=_concatenated(parts, lambda part: part.radii, ()),
        weights=_concatenated(parts, lambda part: part.weight, ()),
        colors=_optional(parts, lambda part: part.colors, scene_color),
        velocities=_optional(parts, lambda part: part.velocities, (0.0, 0.0, 0.0)),
        ids=parts[0].ids if len(parts) == 1 else None,
        sources=np.repeat([part.source for part in parts], [len(part) for part in parts]),
    )


def _optional(
    parts: Sequence[BallPart], values_of: Callable[[BallPart], Any], default: tuple[float, ...]
) -> npt.NDArray[np.float32] | None:
    if all(values_of(part) is None for part in parts):
        return None
    return _concatenated(parts, lambda part: default if values_of(part) is None else values_of(part), (3,))


def _concatenated(
    parts: Sequence[BallPart], values_of: Callable[[BallPart], Any], tail: tuple[int, ...]
) -> npt.NDArray[np.float32]:
    columns = [np.broadcast_to(np.asarray(values_of(part), np.float32), (len(part), *tail)) for part in parts]
    return columns[0] if len(columns) == 1 else np.concatenate(columns)
