"""How Blender shows scene-linear colours: by the view transform of the scene, as far as the kind of shading takes it.

What handlers draw into a viewport is shown as it is, past Blender's colour management. So the colours of the fluid go through
the same transform before. Blender itself converts a table of colours for that: it saves an image as a render.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]
Key = tuple[object, ...]

TABLE_SIZE = 65
"""Colours along each axis of a table."""

_LOW, _HIGH, _OFFSET = -6.0, 14 / 3, 1 / 63
"""The axes of a table are ``log2((light + offset) / (1 + offset))``, 0 to 25, as in lib/display.glsl. 1 is in it."""

_PLAIN: Key = ("sRGB", "Standard", "None", None, None)
"""What needs no table: display, view transform, look, white balance, and curves with the exposure."""

_MOST_TRANSFORMS = 32
_MOST_TABLES = 16
"""Animated curves ask for one at each frame, of 3 MB."""


@dataclass(frozen=True, eq=False)
class DisplayTransform:
    """From scene-linear colours to what the display shows.

    Attributes
    ----------
    exposure, gamma
        As in Blender: stops, and the exponent of the display's code values is one by it.
    table
        (TABLE_SIZE, TABLE_SIZE * TABLE_SIZE, 3) code values of the display, 0 to 1, for colours without exposure: red fastest
        along the columns, then green; blue along the rows. None for the sRGB curve alone.
    """

    exposure: float = 0.0
    gamma: float = 1.0
    table: FloatArray | None = None


class ViewTransforms:
    """The transforms of the scenes; tables are made once.

    Attributes
    ----------
    problem
        One sentence that says why colours are shown by the sRGB curve alone; empty where all is well.
    """

    def __init__(self) -> None:
        self.problem = ""
        self._tables: dict[Key, FloatArray | None] = {_PLAIN: None}
        self._missing: dict[Key, str] = {}
        self._transforms: dict[Key, DisplayTransform] = {}

    def of(self, scene: bpy.types.Scene, shading: bpy.types.View3DShading) -> DisplayTransform:
        """What a viewport shows colours through; the same object while nothing of it changes.

        A table that is not there yet is noted, and the sRGB curve is taken meanwhile.
        """
        key, exposure, gamma = _taken_settings(scene, shading)
        if key not in self._tables:
            self._missing[key] = scene.name
        whole_key = (key, exposure, gamma, key in self._tables)
        if whole_key not in self._transforms:
            if len(self._transforms) >= _MOST_TRANSFORMS:
                self._transforms.clear()
            self._transforms[whole_key] = DisplayTransform(exposure, gamma, self._tables.get(key))
        return self._transforms[whole_key]

    @property
    def has_missing(self) -> bool:
        """Whether tables are to be made."""
        return bool(self._missing)

    def make_missing(self) -> None:
        """Make the tables that were missing. Not while Blender draws: it makes data for it, and removes them."""
        while self._missing:
            key, scene_name = self._missing.popitem()
            if len(self._tables) >= _MOST_TABLES:
                self._tables = {_PLAIN: None}
                self._transforms.clear()
            if scene_name in bpy.data.scenes:
                self._tables[key] = self._table(bpy.data.scenes[scene_name], key)

    def _table(self, scene: bpy.types.Scene, key: Key) -> FloatArray | None:
        try:
            return _converted(_table_colors(), scene, key)
        except (OSError, RuntimeError, TypeError) as error:
            self.problem = f"The view transform '{key[1]}' is not applied to the fluid ({error}): Standard is used instead"
            return None


def _taken_settings(scene: bpy.types.Scene, shading: bpy.types.View3DShading) -> tuple[Key, float, float]:
    """What determines the table, the exposure and the gamma: what Blender takes from the scene goes by the kind of shading."""
    view, display = scene.view_settings, scene.display_settings.display_device
    if shading.type in ("WIREFRAME", "SOLID"):
        return (display, *_PLAIN[1:]), 0.0, 1.0
    uses_all = _uses_scene(shading) or scene.render.engine == "BLENDER_WORKBENCH"
    if not uses_all:
        return (display, view.view_transform, view.look, *_PLAIN[3:]), 0.0, 1.0
    white_balance = (view.white_balance_temperature, view.white_balance_tint) if _has_white_balance(view) else None
    if not view.use_curve_mapping:
        return (display, view.view_transform, view.look, white_balance, None), view.exposure, view.gamma
    # Curves come before the exposure, which is then in the table.
    curves = (_curves(view.curve_mapping), view.exposure)
    return (display, view.view_transform, view.look, white_balance, curves), 0.0, view.gamma


def _uses_scene(shading: bpy.types.View3DShading) -> bool:
    """Whether a viewport is lit by the scene's lights or its world."""
    if shading.type == "RENDERED":
        return bool(shading.use_scene_lights_render or shading.use_scene_world_render)
    return bool(shading.use_scene_lights or shading.use_scene_world)


def _has_white_balance(view: bpy.types.ColorManagedViewSettings) -> bool:
    # There is none before 4.3.
    return bool(getattr(view, "use_white_balance", False))


def _curves(mapping: bpy.types.CurveMapping) -> Key:
    points = (((*point.location, point.handle_type) for point in curve.points) for curve in mapping.curves)
    return (tuple(map(tuple, points)), tuple(mapping.black_level), tuple(mapping.white_level), mapping.tone)


def _table_colors() -> FloatArray:
    """Scene-linear colours of the table's cells, in its layout."""
    axis = np.exp2(np.linspace(_LOW, _HIGH, TABLE_SIZE)) * (1 + _OFFSET) - _OFFSET
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.stack([red, green, blue], -1).astype(np.float32).reshape(TABLE_SIZE, TABLE_SIZE**2, 3)


def _converted(colors: FloatArray, scene: bpy.types.Scene, key: Key) -> FloatArray:
    """(height, width, 3) code values of the display of scene-linear colours, through settings of a scene."""
    converter = bpy.data.scenes.new("Meniscus View Transform")
    source = bpy.data.images.new("Meniscus View Transform", colors.shape[1], colors.shape[0], float_buffer=True)
    try:
        _set_up(converter, scene, key)
        source.pixels.foreach_set(_with_alpha(colors).reshape(-1))
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder, "table.png"))
            source.save_render(path, scene=converter)
            return _read(path, colors.shape)
    finally:
        bpy.data.images.remove(source)
        bpy.data.scenes.remove(converter)


def _set_up(converter: bpy.types.Scene, scene: bpy.types.Scene, key: Key) -> None:
    display, transform, look, white_balance, curves = key
    converter.display_settings.display_device = display
    view = converter.view_settings
    view.view_transform, view.look = transform, look
    if white_balance is not None:
        view.use_white_balance = True
        view.white_balance_temperature, view.white_balance_tint = white_balance
    if curves is not None:
        view.use_curve_mapping, view.exposure = True, curves[1]
        _copy_curves(scene.view_settings.curve_mapping, view.curve_mapping)
    image = converter.render.image_settings
    image.file_format, image.color_mode, image.color_depth, image.compression = "PNG", "RGB", "16", 0


def _copy_curves(source: bpy.types.CurveMapping, target: bpy.types.CurveMapping) -> None:
    target.black_level, target.white_level, target.tone = source.black_level, source.white_level, source.tone
    for old, new in zip(source.curves, target.curves, strict=True):
        while len(new.points) < len(old.points):
            new.points.new(0.5, 0.5)
        for point, made in zip(old.points, new.points, strict=True):
            made.location, made.handle_type = point.location, point.handle_type
    target.update()


def _with_alpha(colors: FloatArray) -> FloatArray:
    return np.concatenate([colors, np.ones_like(colors[..., :1])], -1)


def _read(path: str, shape: tuple[int, ...]) -> FloatArray:
    """The numbers of an image file as they are."""
    image = bpy.data.images.load(path)
    try:
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(shape[0] * shape[1] * 4, np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return np.ascontiguousarray(pixels.reshape(shape[0], shape[1], 4)[..., :3])
