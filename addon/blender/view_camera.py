"""The camera of a 3D viewport."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera, Window
from ..fluid.errors import InputError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ViewCamera:
    """What a viewport looks through.

    Attributes
    ----------
    camera
        Of the whole viewport; its region is the part in which there may be something. In an orthographic view its eye is moved
        forward to where the fluid begins: Blender's lies as far from it as the view reaches, and depths would lose digits.
    depth_offset
        How far the eye was moved: planar depths from Blender's eye are this much greater.
    projection
        (4, 4): Blender's own, OpenGL's convention, from Blender's eye.
    """

    camera: Camera
    depth_offset: float
    projection: FloatArray

    def rectangle_of(self, window: Window) -> tuple[float, float, float, float]:
        """Where in the viewport a window lies: left, bottom, right, top in normalized device coordinates."""
        whole = self.camera.window
        x, y = 2 / (whole.right - whole.left), 2 / (whole.top - whole.bottom)
        return (
            (window.left - whole.left) * x - 1,
            (window.bottom - whole.bottom) * y - 1,
            (window.right - whole.left) * x - 1,
            (window.top - whole.bottom) * y - 1,
        )

    def offset_of(self, camera: Camera) -> float:
        """What to add to the planar depths of an earlier camera that looked the same way."""
        return self.depth_offset + float((self.camera.eye - camera.eye) @ camera.world_from_view[:3, 2])


def view_camera(
    view_from_world: npt.ArrayLike, projection: npt.ArrayLike, width: int, height: int, bounds: FloatArray
) -> ViewCamera | None:
    """The camera of a view; None where nothing can be in it.

    Parameters
    ----------
    view_from_world, projection
        (4, 4): the matrices that Blender draws with.
    width, height
        Size of the viewport in pixels.
    bounds
        (2, 3): the box around what is to be seen, world space.

    Raises
    ------
    InputError
        The matrices are not those of a perspective or an orthographic view.
    """
    seen = whole_view(view_from_world, projection, width, height, bounds)
    region = seen.camera.region_of(bounds)
    return None if region is None else replace(seen, camera=replace(seen.camera, region=region))


def whole_view(
    view_from_world: npt.ArrayLike, projection: npt.ArrayLike, width: int, height: int, bounds: FloatArray
) -> ViewCamera:
    """The same, whatever is in it."""
    matrix = np.asarray(projection, np.float64)
    world_from_view = rigid(np.linalg.inv(np.asarray(view_from_world, np.float64)))
    if matrix[3, 3] == 0:
        near, far = matrix[2, 3] / (matrix[2, 2] - 1), matrix[2, 3] / (matrix[2, 2] + 1)
        camera = Camera(world_from_view, window_of(matrix, True), True, width, height, near, far)
        return ViewCamera(camera, 0.0, matrix)
    near, far = (matrix[2, 3] + 1) / matrix[2, 2], (matrix[2, 3] - 1) / matrix[2, 2]
    start = _nearest(world_from_view, bounds, near, far)
    world_from_view[:3, 3] -= start * world_from_view[:3, 2]
    camera = Camera(world_from_view, window_of(matrix, False), False, width, height, 0.0, far - start)
    return ViewCamera(camera, start, matrix)


def _nearest(world_from_view: FloatArray, bounds: FloatArray, near: float, far: float) -> float:
    """Planar depth from which there is something to see; less than `far`."""
    depths = (bounds - world_from_view[:3, 3]) * -world_from_view[:3, 2]
    return float(np.clip(depths.min(axis=0).sum(), near, far - 1e-3 * (far - near)))


def rigid(transform: FloatArray) -> FloatArray:
    """(4, 4): the nearest transform with exactly orthogonal axes of length 1; Blender's are made of floats.

    Raises
    ------
    InputError
        It is far from one.
    """
    nearest = transform.copy()
    left, sizes, right = np.linalg.svd(transform[:3, :3])
    if not np.allclose(sizes, 1, atol=1e-3):
        raise InputError("The view is scaled or sheared: look through a camera whose parents are not")
    nearest[:3, :3] = left @ right
    return nearest


def window_of(projection: FloatArray, is_perspective: bool) -> Window:
    """What an OpenGL projection (4, 4) shows."""
    size_x, size_y = 2 / projection[0, 0], 2 / projection[1, 1]
    middle = projection[:2, 2] if is_perspective else -projection[:2, 3]
    return Window(
        size_x * (middle[0] - 1) / 2,
        size_x * (middle[0] + 1) / 2,
        size_y * (middle[1] - 1) / 2,
        size_y * (middle[1] + 1) / 2,
    )
