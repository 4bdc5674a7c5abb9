"""Balls from mesh vertices and point clouds, through their attributes."""

from __future__ import annotations

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.errors import InputError
from .ball_part import BallPart, FloatArray, mean_scale, transformed_points, transformed_vectors
from .visible_sources import Source

# Attribute types by what they can be read as: the name of the value, its numbers an element and their type.
_NUMBER_TYPES = {"FLOAT": ("value", 1, np.float32), "INT": ("value", 1, np.int32), "INT8": ("value", 1, np.int32)}
_INTEGER_TYPES = {"INT": ("value", 1, np.int32)}
_VECTOR_TYPES = {"FLOAT_VECTOR": ("vector", 3, np.float32)}
_COLOR_TYPES = {"FLOAT_COLOR": ("color", 4, np.float32), "BYTE_COLOR": ("color", 4, np.float32), **_VECTOR_TYPES}


def read_points(source: Source, depsgraph: bpy.types.Depsgraph) -> list[BallPart]:
    """The points of a source's mesh or point cloud, as one part; none where there is no geometry.

    Parameters
    ----------
    source
        A fluid object. Its attributes are in its own space: positions, velocities and radii are carried to the world.
    depsgraph
        The dependency graph that evaluated it.

    Raises
    ------
    InputError
        The object can have no points, or they lack an attribute that the settings ask for.
    """
    data = source.data
    if not isinstance(data, (bpy.types.Mesh, bpy.types.PointCloud)):
        _check_can_have_points(source)
        return []
    if not (isinstance(data, bpy.types.Mesh) and data.is_editmode):
        return _read_geometry(source, data)
    # A mesh in edit mode shows no attributes, a copy does.
    copy = source.object.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    try:
        return _read_geometry(source, copy)
    finally:
        source.object.to_mesh_clear()


def _read_geometry(source: Source, data: bpy.types.Mesh | bpy.types.PointCloud) -> list[BallPart]:
    positions = _attribute(data, "position", _VECTOR_TYPES)
    if positions is None or len(positions) == 0:
        return []
    move = source.world_from_object
    velocities = _attribute(data, "velocity", _VECTOR_TYPES)
    return [
        BallPart(
            positions=transformed_points(positions, move),
            radii=_radii(source, data, len(positions)) * mean_scale(move),
            weight=source.settings.weight,
            colors=_colors(source, data),
            velocities=None if velocities is None else transformed_vectors(velocities, move),
            ids=_attribute(data, "id", _INTEGER_TYPES),
            world_from_object=move if source.place_may_move else None,
        )
    ]


def _check_can_have_points(source: Source) -> None:
    makes_points = any(modifier.type == "NODES" for modifier in source.object.modifiers)
    if source.is_object_itself and not makes_points:
        raise InputError(
            f"'{source.object.name}' has neither particles nor points: "
            "give it a particle system, a mesh or a point cloud, or do not use it as fluid"
        )


def _radii(source: Source, data: bpy.types.ID, count: int) -> FloatArray:
    settings = source.settings
    if settings.radius_mode == "FIXED":
        return np.full(count, settings.radius, np.float32)
    if settings.radius_mode == "ATTRIBUTE":
        return _required(source.object, data, settings.radius_attribute, _NUMBER_TYPES, "number").astype(np.float32)
    return _required(source.object, data, "radius", _NUMBER_TYPES, "number") * np.float32(settings.radius_factor)


def _colors(source: Source, data: bpy.types.ID) -> FloatArray | None:
    settings = source.settings
    if settings.color_mode == "FIXED":
        return np.array(settings.color, np.float32)
    if settings.color_mode == "ATTRIBUTE":
        return _required(source.object, data, settings.color_attribute, _COLOR_TYPES, "colour")[:, :3]
    return None


def _required(item: bpy.types.Object, data: bpy.types.ID, name: str, types: dict[str, tuple], kind: str) -> npt.NDArray:
    """The values of an attribute on points; InputError says what is wrong where they cannot be read."""
    values = _attribute(data, name, types)
    if values is not None:
        return values
    attribute = data.attributes.get(name)
    if attribute is None:
        problem = f"have no attribute '{name}'"
    elif attribute.domain != "POINT":
        problem = f"have no attribute '{name}': it is on the domain {attribute.domain}"
    else:
        problem = f"have an attribute '{name}' of the type {attribute.data_type}, which is no {kind}"
    raise InputError(
        f"The points of '{item.name}' {problem}; store a {kind} on its points or choose otherwise in its Meniscus panel"
    )


def _attribute(data: bpy.types.ID, name: str, types: dict[str, tuple]) -> npt.NDArray | None:
    """(N,) or (N, channels) values on points, None where there is no such attribute of one of the `types`."""
    attribute = data.attributes.get(name)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type not in types:
        return None
    value, channels, dtype = types[attribute.data_type]
    values = np.empty(len(attribute.data) * channels, dtype)
    attribute.data.foreach_get(value, values)
    return values if channels == 1 else values.reshape(-1, channels)
