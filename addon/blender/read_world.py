"""The world of a Blender scene: one colour, or an equirectangular image."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.lighting import Vector, WorldImage
from .nodes import NodeValues, output_source, scaled, source_of
from .scene_notes import note

_LARGEST_WIDTH = 4096
"""Of an image of the world, pixels; larger ones are halved: mirrors in a liquid show no more."""

_BLACK = (0.0, 0.0, 0.0)
_UPRIGHT = np.eye(3)


def read_world(world: bpy.types.World | None) -> tuple[Vector, WorldImage | None]:
    """Radiance of an evaluated world's background, and its image where it has one.

    Where it is neither one colour nor an image, the colour of its viewport display counts.
    """
    if world is None:
        return _BLACK, None
    node = output_source(world, "Surface")
    if node is None:
        return tuple(world.color), None
    if node.type != "BACKGROUND":
        return _unread(world, f"it is made by the node '{node.name}'"), None
    values = NodeValues(node)
    strength = values.number("Strength", 1.0)
    source = source_of(node.inputs["Color"])
    if source is not None and source.node.type == "TEX_ENVIRONMENT":
        image = _read_image(world, source.node, strength)
        return (tuple(world.color), None) if image is None else (image.mean, image)
    color = values.color("Color", tuple(world.color))
    if values.unread:
        return _unread(world, f"nodes are linked to its {' and '.join(values.unread)}"), None
    return scaled(color, strength), None


def _unread(world: bpy.types.World, reason: str) -> Vector:
    note(f"The world '{world.name}' is shown in the colour of its viewport display, because {reason}; it may be one colour or "
         "an Environment Texture")  # fmt: skip
    return tuple(world.color)


def _read_image(world: bpy.types.World, texture: bpy.types.Node, strength: float) -> WorldImage | None:
    image = texture.image
    if image is None or image.source not in {"FILE", "GENERATED"} or not all(image.size):
        _unread(world, "its Environment Texture has no image that can be read")
        return None
    if texture.projection != "EQUIRECTANGULAR":
        _unread(world, "its Environment Texture is no equirectangular one")
        return None
    turn = _rotation(source_of(texture.inputs["Vector"]))
    if turn is None:
        _unread(world, "the vector of its Environment Texture comes from more than one Mapping that rotates")
        return None
    return _IMAGES.of(image, strength, turn)


def _rotation(source: bpy.types.NodeSocket | None) -> npt.NDArray[np.float64] | None:
    """How the directions of the world are turned before they are looked up; None where more is done to them."""
    if _is_direction(source):
        return _UPRIGHT
    mapping = source.node
    if mapping.type != "MAPPING" or not _is_direction(source_of(mapping.inputs["Vector"])):
        return None
    values = NodeValues(mapping)
    euler = _turn_about_axes(values.color("Rotation", _BLACK))
    scale = np.array(values.color("Scale", (1.0, 1.0, 1.0)))
    moves = mapping.vector_type in {"POINT", "TEXTURE"} and any(values.color("Location", _BLACK))
    if values.unread or moves or not scale.all() or np.ptp(np.abs(scale)) > 1e-6:
        return None
    signs = np.diag(np.sign(scale))
    return signs @ euler.T if mapping.vector_type == "TEXTURE" else euler @ signs


def _turn_about_axes(angles: Vector) -> npt.NDArray[np.float64]:
    """The rotation about x, then y, then z."""
    cosines, sines = np.cos(angles), np.sin(angles)
    about_x = np.array([(1, 0, 0), (0, cosines[0], -sines[0]), (0, sines[0], cosines[0])])
    about_y = np.array([(cosines[1], 0, sines[1]), (0, 1, 0), (-sines[1], 0, cosines[1])])
    about_z = np.array([(cosines[2], -sines[2], 0), (sines[2], cosines[2], 0), (0, 0, 1)])
    turn: npt.NDArray[np.float64] = about_z @ about_y @ about_x
    return turn


def _is_direction(source: bpy.types.NodeSocket | None) -> bool:
    """Whether an output gives the direction in the world; what nothing is linked to, does."""
    if source is None:
        return True
    node = source.node
    return node.type == "TEX_COORD" and source.identifier in {"Generated", "Object"} and node.object is None


@dataclass(frozen=True)
class _Kept:
    """What was read of an image, and in which state that was."""

    state: tuple[object, ...]
    pixels: npt.NDArray[np.float32]
    image: WorldImage


class _Images:
    """Images of worlds, each read once as long as it stays the same: readers tell by identity whether one has changed."""

    def __init__(self) -> None:
        self._kept: dict[int, _Kept] = {}

    def of(self, image: bpy.types.Image, strength: float, turn: npt.NDArray[np.float64]) -> WorldImage:
        """The image of a world."""
        key, state = image.session_uid, (*_state_of(image), strength, *turn.ravel())
        kept = self._kept.get(key)
        if kept is not None and kept.state == state and not image.is_dirty:
            return kept.image
        pixels = _linear_pixels(image) * np.float32(strength)
        if kept is None or kept.state != state or not np.array_equal(kept.pixels, pixels):
            rows = tuple(tuple(row) for row in turn.tolist())
            self._kept = {key: _Kept(state, pixels, WorldImage(pixels, rows))}
        return self._kept[key].image


_IMAGES = _Images()


def _state_of(image: bpy.types.Image) -> tuple[object, ...]:
    """What changes where an image is another one."""
    return image.filepath, tuple(image.size), image.colorspace_settings.name, image.source, image.is_float


def _linear_pixels(image: bpy.types.Image) -> npt.NDArray[np.float32]:
    """(H, W, 3), linear Rec.709, not larger than is needed."""
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    channels = values.reshape(height, width, image.channels)
    pixels = np.ascontiguousarray(channels[..., :3] if image.channels >= 3 else np.repeat(channels[..., :1], 3, axis=2))
    while pixels.shape[1] > _LARGEST_WIDTH and min(pixels.shape[:2]) > 1:
        even = pixels[: pixels.shape[0] // 2 * 2, : pixels.shape[1] // 2 * 2]
        pixels = (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / np.float32(4)
    # Images of floats are linear in memory, those of bytes as they are in the file.
    if image.is_float or image.colorspace_settings.is_data or image.colorspace_settings.name.startswith("Linear"):
        return np.nan_to_num(pixels, posinf=0.0, neginf=0.0)
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4).astype(np.float32)
