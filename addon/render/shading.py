"""The looks but for that of materials: colours of the Combined pass. gpu_shaders/lib/shading.glsl has the same formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.look import SPEED_COLORS, Look
from ..fluid.turning import turned
from .vector_math import FloatArray, dot, fresnel, highlight, schlick, unit

DIELECTRIC = 0.04
"""What most materials reflect of light that falls straight on them."""

GREY_BEHIND = 0.25
"""How light what is seen through water is taken to be."""


@dataclass(frozen=True)
class SurfacePoints:
    """Points of the surface that are shaded, (count,) or (count, 3) each.

    Attributes
    ----------
    normal, to_eye, up
        Unit, view space: x to the right, y up, z to the eye. `up` (3,) is the zenith of the world.
    world_normal
        Unit, world space.
    base
        Linear Rec.709.
    velocity
        World space, Blender units a second.
    depth
        Planar, Blender units.
    ball
        Ids.
    thickness
        Length of the way through the fluid, Blender units.
    contrast
        Factor of the light.
    """

    normal: FloatArray
    to_eye: FloatArray
    up: FloatArray
    world_normal: FloatArray
    base: FloatArray
    velocity: FloatArray
    depth: FloatArray
    ball: FloatArray
    thickness: FloatArray
    contrast: FloatArray


@dataclass(frozen=True)
class Shaded:
    """Light from a surface, (count, 3) each, linear Rec.709.

    Attributes
    ----------
    radiance
        What comes from the surface itself.
    transmittance
        The share of the light from behind that passes.
    """

    radiance: FloatArray
    transmittance: FloatArray

    def over(self, behind: FloatArray) -> FloatArray:
        """(count, 4), premultiplied alpha: laid over what is `behind` (count, 4); a grey is where nothing is known of that."""
        dimmed = self.transmittance.mean(axis=1, keepdims=True)
        open_share = 1 - behind[:, 3:]
        # An image has one alpha for all channels, so that what is unknown is dimmed as a whole and its tint is a grey's.
        tint = (self.transmittance - dimmed) * GREY_BEHIND * open_share
        color = self.radiance + self.transmittance * behind[:, :3] + tint
        return np.concatenate([np.maximum(color, 0), 1 - dimmed * open_share], axis=1, dtype=np.float32)


@dataclass(frozen=True)
class Ranges:
    """What depths and speeds are shown between: the least and the greatest each."""

    depth: tuple[float, float]
    speed: tuple[float, float]


def shaded(points: SurfacePoints, look: Look, ranges: Ranges) -> Shaded:
    """Light from points as the look wants it."""
    faces_away = dot(points.normal, points.to_eye) < 0
    normal = np.where(faces_away[:, None], -points.normal, points.normal)
    return _STYLES[look.style](points, look, ranges, normal)


def view_normals(normal: FloatArray, camera: Camera) -> FloatArray:
    """World-space normals (count, 3) in view space."""
    return turned(normal, camera.world_from_view[:3, :3].astype(np.float32))


def directions_to_eye(camera: Camera, hit: npt.NDArray[np.bool_]) -> FloatArray:
    """(count, 3) unit, view space: from the surface to the eye, at the pixels (height, width) of a whole image that are hit."""
    rows, columns = np.nonzero(hit)
    toward = np.zeros((len(rows), 3), np.float32)
    toward[:, 2] = 1
    if camera.is_perspective:
        x, y = camera.pixel_centers()
        toward[:, 0], toward[:, 1] = -x[columns], -y[rows]
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    return toward


def _opaque(color: FloatArray) -> Shaded:
    return Shaded(color, np.zeros_like(color))


def _mix(low: npt.ArrayLike, high: npt.ArrayLike, share: FloatArray) -> FloatArray:
    """(count, 3) between two colours."""
    return np.asarray(low, np.float32) + share[:, None] * (np.asarray(high, np.float32) - np.asarray(low, np.float32))


def _smoothstep(low: float, high: float, value: FloatArray) -> FloatArray:
    place = np.clip((value - low) / (high - low), 0, 1)
    return np.asarray(place * place * (3 - 2 * place))


def _reflected(to_eye: FloatArray, normal: FloatArray) -> FloatArray:
    return np.asarray(2 * dot(normal, to_eye)[:, None] * normal - to_eye)


def _studio_room(direction: FloatArray, light: FloatArray, roughness: float) -> FloatArray:
    """A studio: floor and ceiling, and a soft box around the key light."""
    room = _mix((0.10, 0.10, 0.11), (0.55, 0.60, 0.68), _smoothstep(-0.6, 0.9, direction[:, 1]))
    blur = 0.04 + 0.5 * roughness
    box = _smoothstep(0.86 - blur, 0.86 + blur, dot(direction, light))
    return np.asarray(room + box[:, None] * (1 - 0.6 * roughness) * np.array([1.9, 1.85, 1.75], np.float32))


def _studio(points: SurfacePoints, look: Look, _ranges: Ranges, normal: FloatArray) -> Shaded:
    light = np.array(look.light_direction, np.float32)
    key = np.clip((dot(normal, light) + 0.25) / 1.25, 0, 1)
    from_below = unit(np.array([-light[0], -0.35, 0.55], np.float32))
    fill = np.clip(dot(normal, from_below), 0, 1)
    soft = _mix((0.45, 0.42, 0.40), (0.85, 0.92, 1.0), 0.5 + 0.5 * normal[:, 1])
    diffuse = (0.95 * key * key)[:, None] * np.array([1.0, 0.97, 0.92], np.float32)
    diffuse = (1 - look.ambient) * (diffuse + (0.18 * fill)[:, None] * np.array([0.7, 0.85, 1.0], np.float32))
    mirrored = _reflected(points.to_eye, normal)
    straight = DIELECTRIC + look.metallic * (points.base - DIELECTRIC)
    share = schlick(dot(normal, points.to_eye), straight) * (1 - 0.7 * look.roughness)
    gloss = share * _studio_room(mirrored, light, look.roughness)
    shine = schlick(dot(light, unit(light + points.to_eye)), straight)
    gloss += shine * highlight(normal, points.to_eye, light, look.roughness)[:, None]
    color = (1 - look.metallic) * points.base * ((0.3 + look.ambient) * soft + diffuse) + gloss
    return _opaque((look.light_strength * points.contrast)[:, None] * color)


def _sky(up: FloatArray) -> FloatArray:
    """Over open ground; `up` (count,) are the cosines to the zenith."""
    above = _mix((0.80, 0.86, 0.92), (0.20, 0.40, 0.75), np.clip(up, 0, 1) ** 0.6)
    ground = np.array([0.16, 0.17, 0.16], np.float32)
    return np.asarray(ground + _smoothstep(-0.25, 0.05, up)[:, None] * (above - ground))


def _water(points: SurfacePoints, look: Look, _ranges: Ranges, normal: FloatArray) -> Shaded:
    reflected = fresnel(np.maximum(dot(normal, points.to_eye), 1e-3), look.ior)
    light = np.array(look.light_direction, np.float32)
    sun = highlight(normal, points.to_eye, light, 0.05 + 0.6 * look.roughness)
    mirrored = _reflected(points.to_eye, normal)
    mirrored = unit(mirrored + look.roughness**2 * (normal - mirrored))
    base = np.clip(points.base, 0, 1)
    passes = np.exp(-look.absorption * points.thickness[:, None] * (1 - base))
    key = np.clip((dot(normal, light) + 0.5) / 1.5, 0, 1)
    lit = (0.4 + 1.6 * key * key)[:, None] * _sky(0.5 + 0.5 * dot(normal, points.up))
    within = (1 - passes) * base * lit
    color = reflected[:, None] * _sky(dot(mirrored, points.up)) + (12 * reflected * sun)[:, None]
    color += (1 - reflected)[:, None] * within
    return Shaded((look.light_strength * points.contrast)[:, None] * color, (1 - reflected)[:, None] * passes)


def _headlight(points: SurfacePoints, look: Look, _ranges: Ranges, normal: FloatArray) -> Shaded:
    light = look.ambient + (1 - look.ambient) * dot(normal, points.to_eye)
    return _opaque((points.contrast * light)[:, None] * points.base)


def _flat(points: SurfacePoints, _look: Look, _ranges: Ranges, _normal: FloatArray) -> Shaded:
    return _opaque(points.base)


def _normal(points: SurfacePoints, _look: Look, _ranges: Ranges, _turned: FloatArray) -> Shaded:
    return _opaque((0.5 + 0.5 * np.clip(points.world_normal, -1, 1)) ** 2.2)


def _depth(points: SurfacePoints, _look: Look, ranges: Ranges, _normal: FloatArray) -> Shaded:
    light = (1 - 0.9 * _share_of_range(points.depth, ranges.depth)) ** 2.2
    return _opaque(np.repeat(light[:, None], 3, axis=1))


def _speed(points: SurfacePoints, look: Look, ranges: Ranges, _normal: FloatArray) -> Shaded:
    speeds = np.linalg.norm(points.velocity, axis=1)
    return _opaque(speed_colors(_share_of_range(speeds, look.speed_range or ranges.speed)))


def speed_colors(place: FloatArray) -> FloatArray:
    """(count, 3) linear Rec.709: colours from slow, 0, to fast, 1."""
    knots = np.linspace(0, 1, len(SPEED_COLORS))
    channels = (np.interp(place, knots, channel) for channel in np.array(SPEED_COLORS).T)
    return np.stack(list(channels), axis=-1).astype(np.float32)


def _id(points: SurfacePoints, _look: Look, _ranges: Ranges, _normal: FloatArray) -> Shaded:
    number = _scrambled(np.maximum(points.ball, 0).astype(np.uint32))
    hue = (number & 65535) / np.float32(65536) * 6
    saturation = 0.5 + 0.45 * ((number >> 16) & 255) / np.float32(255)
    value = 0.7 + 0.3 * (number >> 24) / np.float32(255)
    pure = np.clip(np.abs((hue[:, None] + np.array([0, 4, 2], np.float32)) % 6 - 3) - 1, 0, 1)
    color = value[:, None] * (1 + saturation[:, None] * (pure - 1))
    return _opaque(color * color)


def _scrambled(number: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """A permuted congruential generator's step (O'Neill 2014)."""
    state = number * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return np.asarray((word >> np.uint32(22)) ^ word)


def _share_of_range(value: FloatArray, ends: tuple[float, float]) -> FloatArray:
    return np.asarray(np.clip((value - ends[0]) / max(ends[1] - ends[0], 1e-12), 0, 1), np.float32)


_STYLES: dict[str, Callable[[SurfacePoints, Look, Ranges, FloatArray], Shaded]] = {
    "studio": _studio,
    "water": _water,
    "headlight": _headlight,
    "flat": _flat,
    "normal": _normal,
    "depth": _depth,
    "speed": _speed,
    "id": _id,
}
