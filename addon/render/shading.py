"""The Combined pass: a plain headlight."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..fluid.look import Look


def headlight(
    normal: npt.NDArray[np.float32],
    direction: npt.NDArray[np.float64],
    color: npt.NDArray[np.float32] | None,
    hit: npt.NDArray[np.bool_],
    look: Look,
) -> npt.NDArray[np.float32]:
    """Light from the eye on a diffuse surface; both of its sides are lit.

    Parameters
    ----------
    normal, direction
        (height, width, 3), unit, both in one space: surface normals and ray directions.
    color
        (height, width, 3) linear Rec.709, None: the look's colour.
    hit
        (height, width): where there is a surface.

    Returns
    -------
    (height, width, 4) float32: linear Rec.709, premultiplied alpha.
    """
    facing = np.abs(np.einsum("ijk,ijk->ij", normal, direction))
    light = look.ambient + (1 - look.ambient) * facing
    rgba = np.zeros((*hit.shape, 4), np.float32)
    rgba[..., :3] = light[..., None] * (np.asarray(look.color, np.float32) if color is None else color)
    rgba[..., 3] = 1
    rgba[~hit] = 0
    return rgba
