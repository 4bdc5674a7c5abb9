"""The camera of a Blender scene."""

from __future__ import annotations

import bpy
import numpy as np

from ..fluid.camera import Camera, Region
from ..fluid.errors import InputError
from .view_camera import window_of

_LARGEST_SHEAR = 1e-3
"""Greatest cosine between two axes of a camera that still counts as a rotation."""


def read_camera(
    depsgraph: bpy.types.Depsgraph,
    camera_object: bpy.types.Object | None = None,
    resolution: tuple[int, int] | None = None,
) -> Camera:
    """The camera as Blender renders with it at the current frame.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    camera_object
        The camera; None for the scene's.
    resolution
        Width and height of the whole image in pixels; None for the scene's resolution by its percentage.

    Returns
    -------
    Camera
        With a render border it has a region, or shows only the border if the scene crops to it.

    Raises
    ------
    InputError
        There is no camera, it is panoramic or sheared, or the render border is empty.
    """
    render = depsgraph.scene_eval.render
    camera = _evaluated_camera(depsgraph, camera_object)
    width, height = resolution or resolution_of(render)
    aspect_x, aspect_y = render.pixel_aspect_x, render.pixel_aspect_y
    projection = camera.calc_matrix_camera(depsgraph, x=width, y=height, scale_x=aspect_x, scale_y=aspect_y)
    whole = Camera(
        world_from_view=_world_from_view(camera),
        window=window_of(np.array(projection), camera.data.type == "PERSP"),
        is_perspective=camera.data.type == "PERSP",
        width=width,
        height=height,
        clip_start=camera.data.clip_start,
        clip_end=camera.data.clip_end,
        pixel_aspect=aspect_x / aspect_y,
        region=_border(render, width, height) if render.use_border else None,
    )
    return whole.cropped() if render.use_border and render.use_crop_to_border else whole


def _evaluated_camera(depsgraph: bpy.types.Depsgraph, camera_object: bpy.types.Object | None) -> bpy.types.Object:
    camera = camera_object or depsgraph.scene.camera
    if camera is None:
        raise InputError(f"The scene '{depsgraph.scene.name}' has no camera: add one and make it the active camera")
    if camera.type != "CAMERA":
        raise InputError(f"'{camera.name}' is not a camera: choose a camera object")
    evaluated = camera.evaluated_get(depsgraph)
    if evaluated.data.type not in {"PERSP", "ORTHO"}:
        raise InputError(f"The camera '{camera.name}' is panoramic: make it perspective or orthographic")
    return evaluated


def resolution_of(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Width and height in pixels, rounded down as Blender does."""
    percentage = render.resolution_percentage
    return render.resolution_x * percentage // 100, render.resolution_y * percentage // 100


def _world_from_view(camera: bpy.types.Object) -> np.ndarray:
    """(4, 4) float64: the camera's transform without its scale, which Blender ignores."""
    transform = np.array(camera.matrix_world, np.float64)
    lengths = np.linalg.norm(transform[:3, :3], axis=0)
    if not np.all(lengths > 0):
        raise InputError(f"The camera '{camera.name}' has no extent: give it a scale other than 0")
    axes = transform[:3, :3] / lengths
    if np.max(np.abs(axes.T @ axes - np.eye(3))) > _LARGEST_SHEAR:
        raise InputError(f"The camera '{camera.name}' is sheared by the scale of its parents: apply their scale")
    # The nearest matrix with exactly orthogonal axes: Blender's is made of floats.
    left, _, right = np.linalg.svd(axes)
    transform[:3, :3] = left @ right
    return transform


def _border(render: bpy.types.RenderSettings, width: int, height: int) -> Region:
    """The render border in pixels, rounded down as Blender does."""
    x_min, x_max = int(render.border_min_x * width), int(render.border_max_x * width)
    y_min, y_max = int(render.border_min_y * height), int(render.border_max_y * height)
    if x_min >= x_max or y_min >= y_max:
        raise InputError("The render border holds no pixel: draw a larger one or clear it")
    return Region(x_min, y_min, x_max, y_max)
