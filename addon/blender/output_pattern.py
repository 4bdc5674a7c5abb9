"""Where the files of a render go."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..fluid.errors import InputError
from ..output.file_names import Value, expanded, numbered_pattern
from .read_camera import resolution_of
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
        The path is a folder, is relative to a file that is not saved, or has tokens that make no sense.
    """
    if not bpy.data.filepath and (pattern.startswith("//") or "{blend_dir" in pattern):
        raise InputError(f"'{pattern}' is relative to the .blend file, but none is open; give an absolute path")
    absolute = Path(bpy.path.abspath(pattern)).absolute()
    if pattern.endswith(("/", "\\")) or absolute.is_dir():
        raise InputError(f"'{pattern}' is a folder; add a file name such as fluid_####.exr")
    # Braces in the names of folders that are there are no tokens.
    folder = next(parent for parent in absolute.parents if parent.is_dir())
    named = str(folder / expanded(str(absolute.relative_to(folder)), _tokens(scene, view_layer, settings)))
    if not named.lower().endswith(".exr"):
        named += ".exr"
    return named if frame_count == 1 else numbered_pattern(named)


def _tokens(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, settings: RenderSettings) -> dict[str, Value]:
    render, camera = scene.render, settings.camera or scene.camera
    width, height = settings.resolution or resolution_of(render)
    blend = Path(bpy.data.filepath)
    library = Path(bpy.path.abspath(scene.library.filepath)) if scene.library else blend
    return {
        "blend_name": blend.stem or "Unsaved",
        "blend_dir": blend.parent,
        "blend_name_lib": library.stem or "Unsaved",
        "blend_dir_lib": library.parent,
        "scene_name": scene.name,
        "view_layer": view_layer.name,
        "camera_name": camera.name if camera is not None else "",
        "fps": render.fps / render.fps_base,
        "resolution_x": width,
        "resolution_y": height,
    }
