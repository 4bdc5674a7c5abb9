"""Lights and the world of a Blender scene."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np

from ..fluid.lighting import Light, Lighting, Vector
from .nodes import scaled
from .read_world import read_world


def read_lighting(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None = None) -> Lighting:
    """The lights that a render shows, or those of a viewport, and the world.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    space
        The viewport whose lights count; None for those of a render.
    """
    color, image = read_world(depsgraph.scene_eval.world)
    return Lighting(tuple(_lights(depsgraph, space)), color, image)


def _lights(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None) -> Iterator[Light]:
    for item in depsgraph.objects:
        if item.type != "LIGHT" or not (item.visible_diffuse or item.visible_glossy or item.visible_transmission):
            continue
        if space is None or item.original.visible_get(viewport=space):
            yield _light(item.data, np.array(item.matrix_world, np.float64))


def _light(light: bpy.types.Light, world_from_light: np.ndarray) -> Light:
    size, right, is_round = _area(light, world_from_light) if light.type == "AREA" else ((0.0, 0.0), (1.0, 0.0, 0.0), False)
    return Light(
        kind=light.type,
        power=_power(light),
        position=tuple(world_from_light[:3, 3].tolist()),
        direction=_unit(-world_from_light[:3, 2], (0.0, 0.0, -1.0)),
        cone=(math.cos(light.spot_size / 2), light.spot_blend) if light.type == "SPOT" else (0.0, 0.0),
        radius=_radius(light),
        size=size,
        right=right,
        is_round=is_round,
        casts_shadow=light.use_shadow,
    )


def _power(light: bpy.types.Light) -> Vector:
    strength = light.energy * 2.0 ** getattr(light, "exposure", 0.0)  # since 4.5
    color = scaled(tuple(light.color), strength)
    if getattr(light, "use_temperature", False):
        color = tuple(mine * theirs for mine, theirs in zip(color, light.temperature_color, strict=True))
    return color


def _radius(light: bpy.types.Light) -> float:
    """Of a sphere, Blender units; of a sun the half of its angle."""
    if light.type == "SUN":
        return float(light.angle / 2)
    return float(light.shadow_soft_size) if light.type in {"POINT", "SPOT"} else 0.0


def _area(light: bpy.types.AreaLight, world_from_light: np.ndarray) -> tuple[tuple[float, float], Vector, bool]:
    """Width and height of the lamp as it stands in the scene, the direction of its width, and whether it is round."""
    width = light.size
    height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
    across, along = (float(np.linalg.norm(world_from_light[:3, axis])) for axis in (0, 1))
    right = _unit(world_from_light[:3, 0], (1.0, 0.0, 0.0))
    return (width * across, height * along), right, light.shape in {"DISK", "ELLIPSE"}


def _unit(vector: np.ndarray, default: Vector) -> Vector:
    length = np.linalg.norm(vector)
    return tuple((vector / length).tolist()) if length > 0 else default
