"""How long the way through the fluid is, roughly: for light that the fluid takes away.

Each ball stands for a volume of fluid. The volumes behind a pixel, by the pixel's area, are the length of the way. They are
summed at a low resolution and blurred as wide as the balls are, so that no single ball shows.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.field import Field
from ..fluid.kernels import Kernel
from ..fluid.turning import turned
from .depth_contrast import blurred_rows

FloatArray = npt.NDArray[np.float32]

LONGEST_SIDE = 256
"""Pixels of the longer side of an image of thickness."""

_SAMPLES = 24
_SPREAD = 0.4
"""Standard deviation of the blur by a ball's influence radius; the kernels' own lie around it."""

_densities: WeakKeyDictionary[Balls, dict[Field, float]] = WeakKeyDictionary()


def thickness_image(balls: Balls, camera: Camera, field: Field) -> FloatArray:
    """The length of the way through the fluid.

    Parameters
    ----------
    balls, field
        The fluid.
    camera
        What the image shows; it has no region.

    Returns
    -------
    (height, width) float32 of the whole image, Blender units, at a low resolution: at most LONGEST_SIDE pixels a side.
    """
    coarse = _coarse(camera)
    in_view = turned(balls.positions - coarse.eye.astype(np.float32), coarse.world_from_view[:3, :3].astype(np.float32))
    depth = -in_view[:, 2]
    seen = (depth > coarse.clip_start) & (depth < coarse.clip_end) & (depth > 0)
    scale = depth[seen] if coarse.is_perspective else np.float32(1)
    pixel_width, pixel_height = coarse.pixel_size
    x = (in_view[seen, 0] / scale - coarse.window.left) / pixel_width - 0.5
    y = (in_view[seen, 1] / scale - coarse.window.bottom) / pixel_height - 0.5
    lengths = _volumes(balls, field)[seen] / (pixel_width * pixel_height * scale**2)
    deposited = _deposited(x, y, lengths, coarse.width, coarse.height)
    radii = np.broadcast_to(balls.radii[seen] / scale, lengths.shape)
    sigma = _SPREAD * float(np.average(radii, weights=np.abs(lengths) + 1e-30)) if lengths.size else 0.0
    return _blurred(deposited, sigma / pixel_width, sigma / pixel_height)


def at_pixels(image: FloatArray, camera: Camera, hit: npt.NDArray[np.bool_]) -> FloatArray:
    """(count,): an image of thickness at those pixels (height, width) of the camera's whole image that are hit."""
    height, width = image.shape
    rows, columns = np.nonzero(hit)
    y = np.clip((rows + 0.5) / camera.height * height - 0.5, 0, height - 1)
    x = np.clip((columns + 0.5) / camera.width * width - 0.5, 0, width - 1)
    low_y, low_x = y.astype(int), x.astype(int)
    high_y, high_x = np.minimum(low_y + 1, height - 1), np.minimum(low_x + 1, width - 1)
    y, x = y - low_y, x - low_x
    below = image[low_y, low_x] * (1 - x) + image[low_y, high_x] * x
    above = image[high_y, low_x] * (1 - x) + image[high_y, high_x] * x
    return np.asarray(below * (1 - y) + above * y, np.float32)


def typical_density(balls: Balls, field: Field) -> float:
    """Density inside the fluid: the median of those at the centres of some balls."""
    known = _densities.setdefault(balls, {})
    if field not in known:
        known[field] = _median_density(balls, field.density_kernel)
    return known[field]


def _median_density(balls: Balls, kernel: Kernel) -> float:
    # At random, because balls often come in an order; the same ones each time.
    chosen = np.random.default_rng(0).permutation(len(balls))[:_SAMPLES]
    centers = balls.positions[chosen].astype(np.float64)
    densities = [_density_at(center, balls, kernel) for center in centers]
    return max(float(np.median(densities)), 1e-6) if densities else 1.0


def _density_at(point: npt.NDArray[np.float64], balls: Balls, kernel: Kernel) -> float:
    offsets = balls.positions - point.astype(np.float32)
    x = 1 - np.einsum("ij,ij->i", offsets, offsets) / balls.radii**2
    inside = x > 0
    return float(np.sum(balls.weights[inside] * kernel.value(x[inside])))


def _volumes(balls: Balls, field: Field) -> FloatArray:
    """(count,): of the fluid that each ball stands for; balls that carve take some away."""
    content = field.density_kernel.content / typical_density(balls, field)
    return np.asarray(content * balls.weights * balls.radii**3, np.float32)


def _coarse(camera: Camera) -> Camera:
    scale = min(1.0, LONGEST_SIDE / max(camera.width, camera.height))
    return camera.resized(max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))


def _deposited(x: FloatArray, y: FloatArray, amounts: FloatArray, width: int, height: int) -> npt.NDArray[np.float64]:
    """(height, width): amounts spread over the four pixels around each place; what falls outside is lost."""
    low_x, low_y = np.floor(x), np.floor(y)
    image = np.zeros((height, width))
    for step_x in (0, 1):
        for step_y in (0, 1):
            column, row = (low_x + step_x).astype(np.int64), (low_y + step_y).astype(np.int64)
            share = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
            is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            places = row[is_inside] * width + column[is_inside]
            image += np.bincount(places, (amounts * share)[is_inside], width * height).reshape(height, width)
    return image


def _blurred(image: npt.NDArray[np.float64], sigma_x: float, sigma_y: float) -> FloatArray:
    if sigma_x > 0:
        image = blurred_rows(blurred_rows(image, sigma_x).T, sigma_y).T
    return np.maximum(image, 0).astype(np.float32)
