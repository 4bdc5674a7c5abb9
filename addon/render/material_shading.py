"""The look of materials in the light of the scene: a Principled BSDF whose rays end at the first surface.

Each light shines by its own formula, without shadows; the world sends the same light from everywhere. What lies behind a
surface that lets light pass is laid under it by whoever knows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..fluid.lighting import Light, Lighting, Material, Vector
from .vector_math import FloatArray, dot, fresnel, highlight, schlick, unit

Parameters = dict[str, FloatArray]
"""The parameters of materials by name, (count,) or (count, 3): of each point."""


def lighting_in_view(lighting: Lighting, view_from_world: npt.NDArray[np.float64]) -> Lighting:
    """World-space lights in view space."""
    turn, move = view_from_world[:3, :3], view_from_world[:3, 3]
    lights = (
        replace(light, position=_vector(turn @ light.position + move), direction=_vector(turn @ light.direction))
        for light in lighting.lights
    )
    return replace(lighting, lights=tuple(lights))


def material_parameters(materials: tuple[Material, ...], source: npt.NDArray[np.int32]) -> Parameters:
    """The parameters of the materials with the indices `source` (count,)."""
    return {
        name: np.array([getattr(material, name) for material in materials], np.float32)[source]
        for name in ("metallic", "roughness", "transmission", "ior", "emission")
    }


def lit_materials(
    normal: FloatArray, to_eye: FloatArray, position: FloatArray, base: FloatArray, material: Parameters, lighting: Lighting
) -> tuple[FloatArray, FloatArray]:
    """Light that points of a surface send to the eye.

    Parameters
    ----------
    normal, to_eye
        (count, 3) unit; normals face the eye.
    position
        (count, 3), in the space of the lights.
    base
        (count, 3) base colours.
    material, lighting
        The surface and its light.

    Returns
    -------
    radiance, transmittance
        (count, 3) each, linear Rec.709: what the surface sends by itself, and the share of light from behind it that passes.
    """
    metallic, clear = material["metallic"][:, None], material["transmission"][:, None]
    matt = base * (1 - metallic) * (1 - clear)
    reflected = _reflected(dot(normal, to_eye), base, material)
    world = np.asarray(lighting.world, np.float32)
    radiance = material["emission"] + (1 - reflected) * matt * world + reflected * world
    for light in lighting.lights:
        toward, irradiance = _LIGHTS[light.kind](light, position)
        shine = _reflected(dot(toward, unit(to_eye + toward)), base, material)
        facing = np.maximum(dot(normal, toward), 0)[:, None]
        gloss = shine * highlight(normal, to_eye, toward, material["roughness"])[:, None]
        radiance = radiance + irradiance * ((1 - shine) * matt * facing / math.pi + gloss)
    return np.asarray(radiance, np.float32), np.asarray((1 - reflected) * (1 - metallic) * clear * base, np.float32)


def _reflected(cosine: FloatArray, base: FloatArray, material: Parameters) -> FloatArray:
    """(count, 3): what facets reflect of light at an angle to their normal."""
    metallic, cosine = material["metallic"][:, None], np.clip(cosine, 1e-3, 1)
    return np.asarray((1 - metallic) * fresnel(cosine, material["ior"])[:, None] + metallic * schlick(cosine, base))


def _vector(values: npt.NDArray[np.float64]) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])


def _sun(light: Light, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    toward = np.broadcast_to(-np.asarray(light.direction, np.float32), position.shape)
    return toward, np.asarray(light.power, np.float32)[None]


def _point(light: Light, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    toward, squared = _way_to(light, position)
    return toward, np.asarray(light.power, np.float32) / (4 * math.pi * squared)[:, None]


def _spot(light: Light, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    toward, irradiance = _point(light, position)
    cosine, softness = light.cone
    inside = dot(toward, -np.asarray(light.direction, np.float32)) - cosine
    place = np.clip(inside / max((1 - cosine) * softness, 1e-6), 0, 1)
    return toward, irradiance * (place * place * (3 - 2 * place))[:, None]


def _area(light: Light, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Exact on the axis of a disc."""
    toward, squared = _way_to(light, position)
    cosine = np.maximum(dot(toward, -np.asarray(light.direction, np.float32)), 0)
    share = cosine / (math.pi * squared + light.area)
    return toward, np.asarray(light.power, np.float32) * share[:, None]


def _way_to(light: Light, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(count, 3) unit vectors to a light, and the squares of its distances."""
    way = np.asarray(light.position, np.float32) - position
    squared = np.maximum(dot(way, way), 1e-12)
    return way / np.sqrt(squared)[:, None], squared


_LIGHTS: dict[str, Callable[[Light, FloatArray], tuple[FloatArray, FloatArray]]] = {
    "SUN": _sun,
    "POINT": _point,
    "SPOT": _spot,
    "AREA": _area,
}
