"""Where the files of a render go."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..fluid.errors import InputError
from ..output.file_names import expanded, numbered_pattern
from .render_scene import RenderSettings


def output_pattern(
    pattern: str, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, settings: RenderSettings, frame_count: int
) -> str:
    """An absolute path to EXR files, with its tokens replaced and ``####`` where several frames need it.

    Parameters
    ----------
    pattern
        As the user gave it: ``//`` is the folder of the .blend file.
    scene, view_layer, settings
        What is rendered, for the tokens.
    frame_count
        How many frames there are.

    Raises
    ------
    InputError
        The path is a folder, is relative to a file that is not saved, or has an unknown token.
    """
    if pattern.startswith("//") and not bpy.data.filepath:
        raise InputError(f"'{pattern}' is relative to the .blend file, but none is open; give an absolute path")
    if pattern.endswith(("/", "\\")) or Path(bpy.path.abspath(pattern)).is_dir():
        raise InputError(f"'{pattern}' is a folder; add a file name such as fluid_####.exr")
    # Blender since 5.0 has tokens of its own in paths, and braces that stand for themselves.
    absolute = str(Path(bpy.path.abspath(pattern)).absolute())
    named = expanded(absolute, _tokens(scene, view_layer, settings))
    if not named.lower().endswith(".exr"):
        named += ".exr"
    return named if frame_count == 1 else numbered_pattern(named)


def _tokens(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, settings: RenderSettings) -> dict[str, str]:
    render, camera = scene.render, settings.camera or scene.camera
    width, height = settings.resolution or (
        render.resolution_x * render.resolution_percentage // 100,
        render.resolution_y * render.resolution_percentage // 100,
    )
    return {
        "blend_name": Path(bpy.data.filepath).stem or "untitled",
        "scene_name": scene.name,
        "view_layer": view_layer.name,
        "camera_name": camera.name if camera is not None else "",
        "fps": f"{render.fps / render.fps_base:g}",
        "resolution_x": str(width),
        "resolution_y": str(height),
    }
