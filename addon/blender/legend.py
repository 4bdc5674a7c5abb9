"""The colour map of speeds, drawn into a corner of the viewport."""

from __future__ import annotations

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..render.shading import speed_colors

_STEPS = 64
_WIDTH, _HEIGHT, _MARGIN, _TEXT_SIZE = 200, 12, 24, 11
"""Of the bar and its text, in pixels at a scale of the interface of 1."""


def draw_legend(region: bpy.types.Region, scene: bpy.types.Scene, ends: tuple[float, float]) -> None:
    """Draw the map with the speeds at its ends, Blender units a second; in a POST_PIXEL handler."""
    scale = bpy.context.preferences.system.ui_scale
    left, bottom = _left_of_free_part(region) + _MARGIN * scale, (_MARGIN + 2 * _TEXT_SIZE) * scale
    width, height = _WIDTH * scale, _HEIGHT * scale
    _draw_bar(left, bottom, width, height)
    blf.size(0, _TEXT_SIZE * scale)
    blf.color(0, 1, 1, 1, 1)
    for text, place in ((_speed_text(scene, ends[0]), 0.0), ("Speed", 0.5), (_speed_text(scene, ends[1]), 1.0)):
        text_width, _ = blf.dimensions(0, text)
        blf.position(0, left + place * (width - text_width), bottom - 1.4 * _TEXT_SIZE * scale, 0)
        blf.draw(0, text)


def _left_of_free_part(region: bpy.types.Region) -> int:
    """Where the tools, which lie over the viewport, end."""
    tools = next((other for other in bpy.context.area.regions if other.type == "TOOLS"), None)
    overlaps = tools is not None and tools.width > 1 and tools.x <= region.x < tools.x + tools.width
    return tools.x + tools.width - region.x if overlaps else 0


def _draw_bar(left: float, bottom: float, width: float, height: float) -> None:
    places = np.linspace(0, 1, _STEPS)
    corners = [(left + place * width, bottom + top * height) for place in places for top in (0, 1)]
    # The builtin shader takes colours as the screen shows them.
    colors = np.repeat(_encoded(speed_colors(places.astype(np.float32))), 2, axis=0)
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    content = {"pos": corners, "color": [(*color, 1.0) for color in colors.tolist()]}
    batch_for_shader(shader, "TRI_STRIP", content).draw(shader)


def _encoded(light: np.ndarray) -> np.ndarray:
    """Linear light as code values of an sRGB display."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _speed_text(scene: bpy.types.Scene, speed: float) -> str:
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{speed:.3g}"
    return str(bpy.utils.units.to_string(units.system, "VELOCITY", speed * units.scale_length, precision=3))
