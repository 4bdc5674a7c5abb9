"""The Combined pass: a plain headlight."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.look import Look


def headlight(
    normal: npt.NDArray[np.float32],
    camera: Camera,
    color: npt.NDArray[np.float32] | None,
    hit: npt.NDArray[np.bool_],
    look: Look,
    importance: npt.NDArray[np.float32] | None = None,
) -> npt.NDArray[np.float32]:
    """Light from the eye on a diffuse surface; both of its sides are lit.

    Parameters
    ----------
    normal
        (height, width, 3), unit, world space, of the camera's whole image.
    camera
        Where the light comes from; it has no region.
    color
        (height, width, 3) linear Rec.709, None: the look's colour.
    hit
        (height, width): where there is a surface.
    importance
        (height, width), see :func:`depth_contrast.spatial_importance`; None: the light stays as it is.

    Returns
    -------
    (height, width, 4) float32: linear Rec.709, premultiplied alpha.
    """
    light = np.abs(_cosines(normal, camera))
    light *= 1 - look.ambient
    light += look.ambient
    if importance is not None:
        # Small changes are in proportion to the importance, great ones end at nothing and at twice the light: no halo glows.
        light *= 1 + np.tanh(look.depth_contrast * importance)
    light *= hit
    rgba = np.empty((*hit.shape, 4), np.float32)
    for channel, value in enumerate(look.color):
        np.multiply(light, value if color is None else color[..., channel], out=rgba[..., channel])
    rgba[..., 3] = hit
    return rgba


def _cosines(normal: npt.NDArray[np.float32], camera: Camera) -> npt.NDArray[np.float32]:
    """(height, width): of the angles between normals and rays, negative where the surface faces the eye."""
    right, up, backward = camera.world_from_view[:3, :3].astype(np.float32).T
    cosines: npt.NDArray[np.float32] = normal @ -backward
    if camera.is_perspective:
        x, y = (centers.astype(np.float32) for centers in camera.pixel_centers())
        cosines += x * (normal @ right) + y[:, None] * (normal @ up)
        cosines /= np.sqrt(1 + x**2 + (y**2)[:, None])
    return cosines
