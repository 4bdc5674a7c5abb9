"""Materials, lights and the world of a Blender scene, as far as a look can show them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np

from ..fluid.lighting import FluidSource, Light, Lighting, Material, Vector


def read_source(item: bpy.types.Object, view_layer: bpy.types.ViewLayer, settings: bpy.types.PropertyGroup) -> FluidSource:
    """What a render knows of an evaluated object that supplies balls; `settings` are those of the scene.

    Where it has no material it looks as the scene's settings say.
    """
    material = view_layer.material_override or _material_of(item)
    plain = Material(tuple(settings.color), settings.metallic, settings.roughness, ior=settings.ior)
    is_holdout = item.is_holdout or item.original.holdout_get(view_layer=view_layer)
    return FluidSource(item.name, item.pass_index, plain if material is None else read_material(material), is_holdout)


def read_material(material: bpy.types.Material | None) -> Material:
    """A material as its Principled BSDF has it.

    Inputs that are linked to other nodes differ from place to place: for them the settings of the viewport display count, or
    the defaults. So they do where there is no Principled BSDF.
    """
    if material is None:
        return Material()
    node = _principled(material)
    plain = Material(tuple(material.diffuse_color[:3]), material.metallic, material.roughness)
    if node is None:
        return plain
    emission = _color(node, "Emission Color", (0.0, 0.0, 0.0))
    strength = _number(node, "Emission Strength", 0.0)
    return Material(
        color=_color(node, "Base Color", plain.color),
        metallic=_number(node, "Metallic", plain.metallic),
        roughness=_number(node, "Roughness", plain.roughness),
        transmission=_number(node, "Transmission Weight", 0.0),
        ior=_number(node, "IOR", 1.5),
        emission=_scaled(emission, strength),
    )


def read_lighting(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None = None) -> Lighting:
    """The lights that a render shows, or those of a viewport, and the world.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    space
        The viewport whose lights count; None for those of a render.
    """
    return Lighting(tuple(_lights(depsgraph, space)), _world(depsgraph.scene_eval.world))


def _material_of(item: bpy.types.Object) -> bpy.types.Material | None:
    """The material of an object's first particle system that is not hair, else its first one."""
    slots = item.material_slots
    numbers = [system.settings.material for system in item.particle_systems if system.settings.type != "HAIR"]
    slot = min(numbers[0], len(slots)) - 1 if numbers else 0
    return slots[slot].material if len(slots) else None


def _principled(material: bpy.types.Material) -> bpy.types.Node | None:
    node = _surface_node(material)
    return node if node is not None and node.type == "BSDF_PRINCIPLED" else None


def _surface_node(owner: bpy.types.Material | bpy.types.World) -> bpy.types.Node | None:
    """The node that makes the surface of a material or a world; None where it is made without nodes."""
    # Since 5.0 there are nodes always, and to ask is deprecated.
    if owner.node_tree is None or (bpy.app.version < (5, 0) and not owner.use_nodes):
        return None
    output = owner.node_tree.get_output_node("ALL")
    links = output.inputs["Surface"].links if output is not None else ()
    return links[0].from_node if links else None


def _number(node: bpy.types.Node, name: str, default: float) -> float:
    entry = node.inputs[name]
    return default if entry.is_linked else float(entry.default_value)


def _color(node: bpy.types.Node, name: str, default: Vector) -> Vector:
    entry = node.inputs[name]
    return default if entry.is_linked else tuple(entry.default_value[:3])


def _lights(depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None) -> Iterator[Light]:
    for item in depsgraph.objects:
        if item.type == "LIGHT" and (space is None or item.original.visible_get(viewport=space)):
            yield _light(item.data, np.array(item.matrix_world, np.float64))


def _light(light: bpy.types.Light, world_from_light: np.ndarray) -> Light:
    size, right, is_round = _area(light, world_from_light) if light.type == "AREA" else ((0.0, 0.0), (1.0, 0.0, 0.0), False)
    return Light(
        kind=light.type,
        power=_power(light),
        position=tuple(world_from_light[:3, 3].tolist()),
        direction=_unit(-world_from_light[:3, 2], (0.0, 0.0, -1.0)),
        cone=(math.cos(light.spot_size / 2), light.spot_blend) if light.type == "SPOT" else (0.0, 0.0),
        size=size,
        right=right,
        is_round=is_round,
    )


def _power(light: bpy.types.Light) -> Vector:
    strength = light.energy * 2.0 ** getattr(light, "exposure", 0.0)  # since 4.5
    color = _scaled(tuple(light.color), strength)
    if getattr(light, "use_temperature", False):
        color = tuple(mine * theirs for mine, theirs in zip(color, light.temperature_color, strict=True))
    return color


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


def _world(world: bpy.types.World | None) -> Vector:
    """Radiance of the world's background where it is one colour, else of its viewport display."""
    if world is None:
        return 0.0, 0.0, 0.0
    node = _surface_node(world)
    if node is None or node.type != "BACKGROUND":
        return tuple(world.color)
    return _scaled(_color(node, "Color", tuple(world.color)), _number(node, "Strength", 1.0))


def _scaled(color: Vector, factor: float) -> Vector:
    return color[0] * factor, color[1] * factor, color[2] * factor
