"""Depth contrast: light that sets near parts of the surface apart from what is behind them, by unsharp masking the depth.

After Luft, Colditz and Deussen 2006, whose method Kanamori, Szego and Nishita 2008 use in figure 11.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera

BACKGROUND_GAP = 0.1
"""How far behind the farthest surface the background counts, by the range of the surface's depths: so its outlines show."""

_PASSES = 3
"""Running means that make up the blur; three differ from a Gaussian by 6 % of its peak, which nobody sees."""


def spatial_importance(
    depth: npt.NDArray[np.float32], hit: npt.NDArray[np.bool_], camera: Camera, radius: float
) -> npt.NDArray[np.float32]:
    """How much nearer than its surroundings the surface is: ``G * D - D`` (Luft et al. 2006, section 3).

    D runs from 0 at the nearest visible surface to 1 at the farthest. It is linear in the depth in an orthographic view and
    in its logarithm in a perspective one, so that what looks alike in an image is changed alike, near or far: there a gap
    looks the same at any distance, here where it grows with the distance. A surface that is flatter than the blur is wide
    keeps a smaller range, else its rounding errors would be stretched to the whole. What lies outside a region is not known:
    the range and G are those of the region's pixels, so a part of an image is like that part of the whole only where it shows
    the nearest and the farthest surface, and away from its own edges.

    Parameters
    ----------
    depth
        (height, width) planar distance, Blender units.
    hit
        (height, width): where there is a surface.
    camera
        What the arrays show: its region, or its whole image.
    radius
        Standard deviation of the Gaussian G, by the height of the camera's whole image.

    Returns
    -------
    (height, width) float32, -1.1 to 1.1: positive on what is in front, negative on what is behind, there also where nothing
    is hit.
    """
    if not hit.any():
        return np.zeros(hit.shape, np.float32)
    sigma = radius * (camera.window.top - camera.window.bottom)
    pixel_width, pixel_height = camera.pixel_size
    relative = _relative_depth(depth, hit, camera, sigma)
    blurred = blurred_rows(blurred_rows(relative, sigma / pixel_width).T, sigma / pixel_height).T
    blurred -= relative
    return blurred.astype(np.float32)


def _relative_depth(
    depth: npt.NDArray[np.float32], hit: npt.NDArray[np.bool_], camera: Camera, sigma: float
) -> npt.NDArray[np.float64]:
    """(height, width): D of :func:`spatial_importance`; `sigma` is in units of the camera's window."""
    values = depth[hit].astype(np.float64)
    if camera.is_perspective:
        # A clip start of 0 lets through depths that round to 0.
        np.log(np.maximum(values, np.finfo(np.float32).tiny), out=values)
    nearest = values.min()
    visible_range = values.max() - nearest
    # At any distance, sigma in the window is as wide as a gap of this size is deep.
    unit = max(visible_range, sigma)
    relative = np.full(hit.shape, visible_range / unit + BACKGROUND_GAP)
    relative[hit] = (values - nearest) / unit
    return relative


def blurred_rows(image: npt.NDArray[np.float64], sigma: float) -> npt.NDArray[np.float64]:
    """Each row convolved with nearly a Gaussian of standard deviation `sigma` pixels, at a cost that does not grow with it.

    Running means whose windows end in fractions of a pixel have together exactly the variance of the Gaussian (Gwosdek et al.
    2011, "Theoretical foundations of Gaussian convolution by extended box filtering"). Near the ends of a row each is the
    mean of the pixels that there are.

    Parameters
    ----------
    image
        (height, width).
    sigma
        Greater than 0.

    Returns
    -------
    (height, width) float64.
    """
    reach, end_weight = _window(sigma**2 / _PASSES)
    # A window that holds the whole row wherever it is needs not be larger.
    reach = min(reach, image.shape[1])
    shares = 1 / _running_sums(np.ones((1, image.shape[1])), reach, end_weight)
    # Rows that follow each other in memory are summed several times as fast.
    image = np.ascontiguousarray(image)
    for _ in range(_PASSES):
        image = _running_sums(image, reach, end_weight)
        image *= shares
    return image


def _window(variance: float) -> tuple[int, float]:
    """How many whole pixels a running mean of this variance reaches to each side, and the weight of one more at each end."""
    reach = math.floor((math.sqrt(1 + 12 * variance) - 1) / 2)
    excess = variance - reach * (reach + 1) / 3
    return reach, (2 * reach + 1) * excess / (2 * ((reach + 1) ** 2 - variance))


def _running_sums(image: npt.NDArray[np.float64], reach: int, end_weight: float) -> npt.NDArray[np.float64]:
    """(height, width): sums over the pixels of a row up to `reach` away, plus the next ones by `end_weight`."""
    height, width = image.shape
    margin = reach + 1
    # sums[:, margin + n] is the sum of the first n pixels; what lies outside adds nothing.
    sums = np.zeros((height, width + 2 * margin + 1))
    np.cumsum(image, axis=1, out=sums[:, margin + 1 : margin + 1 + width])
    sums[:, margin + 1 + width :] = sums[:, margin + width, None]
    wider = sums[:, 2 * margin + 1 :] - sums[:, :width]
    wider *= end_weight
    within = sums[:, 2 * margin : -1] - sums[:, 1 : width + 1]
    within *= 1 - end_weight
    within += wider
    return within
