"""The look of materials in the light of the scene, by the native core; native/core/src/shading has the formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.lighting import Light, Lighting, Material, Vector
from . import native
from .surroundings import Color
from .vector_math import FloatArray


def shade_image(
    rgba: FloatArray,
    depth: FloatArray,
    normal: FloatArray,
    color: FloatArray,
    material: npt.NDArray[np.int32],
    camera: Camera,
    materials: tuple[Material, ...],
    lighting: Lighting,
    contrast: FloatArray | None = None,
    behind: Color | None = None,
    threads: int = 0,
    watch: Callable[[float], None] = native.let_interrupt,
) -> None:
    """Lay the light of a surface over what is behind it.

    Parameters
    ----------
    rgba
        (height, width, 4) premultiplied, linear Rec.709: what is behind; is changed to what is seen.
    depth, normal, color
        (height, width), and (height, width, 3) in world space and linear Rec.709.
    material
        (height, width): indices into `materials`, negative where nothing is to be shaded.
    camera
        What the image shows; it has no region.
    lighting
        In world space.
    contrast
        (height, width): a factor of the light; None for 1.
    behind
        The one colour of all that is behind, whatever `rgba` holds; None where it differs.
    threads, watch
        As for :class:`method.Request`.

    Raises
    ------
    DeviceError
        The native core is missing.
    """
    core = native.load()
    in_view = _in_view(lighting, camera.view_from_world)
    with native.translated_errors():
        core.shade_image(
            rgba,
            *map(np.ascontiguousarray, (depth, normal, color)),
            np.ascontiguousarray(material, np.int32),
            None if contrast is None else np.ascontiguousarray(contrast),
            native.view_tuple(camera),
            *_scene(materials, in_view),
            behind=behind,
            threads=threads,
            watch=watch,
        )


def shade_points(
    position: FloatArray,
    normal: FloatArray,
    color: FloatArray,
    material: npt.NDArray[np.int32],
    materials: tuple[Material, ...],
    lighting: Lighting,
) -> FloatArray:
    """(count, 3): the radiance of points that are looked at straight; positions and normals (count, 3) in world space."""
    radiance = np.empty((len(position), 3), np.float32)
    arrays = [np.ascontiguousarray(array, np.float32) for array in (position, normal, normal, color)]
    core = native.load()
    with native.translated_errors():
        core.shade_points(radiance, *arrays, np.ascontiguousarray(material, np.int32), *_scene(materials, lighting))
    return radiance


def _in_view(lighting: Lighting, view_from_world: npt.NDArray[np.float64]) -> Lighting:
    """World-space lights in view space."""
    turn, move = view_from_world[:3, :3], view_from_world[:3, 3]
    lights = (
        replace(light, position=_vector(turn @ light.position + move), direction=_vector(turn @ light.direction))
        for light in lighting.lights
    )
    return replace(lighting, lights=tuple(lights))


def _vector(values: npt.NDArray[np.float64]) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])


def material_tuples(materials: tuple[Material, ...]) -> list[tuple[Any, ...]]:
    """Materials as the core takes them."""
    return [
        (item.metallic, item.roughness, item.transmission, item.ior, item.emission, item.color, item.absorption)
        for item in materials
    ]


def light_tuples(lights: tuple[Light, ...]) -> list[tuple[Any, ...]]:
    """Lights as the core takes them."""
    return [
        (
            *(light.kind, light.position, light.direction, light.power, light.area, light.cone),
            *(light.radius, light.size, light.right, light.is_round, light.casts_shadow),
        )
        for light in lights
    ]


def _scene(materials: tuple[Material, ...], lighting: Lighting) -> tuple[Any, ...]:
    """Materials, lights and world as the core takes them."""
    return material_tuples(materials), light_tuples(lighting.lights), lighting.world
