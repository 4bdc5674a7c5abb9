"""Groups of neighbouring balls, to be asked for all at once whether they can be seen (Kanamori et al. 2008, section 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera
from ....addon.fluid.view_balls import ViewBalls

FloatArray = npt.NDArray[np.float64]

MAX_GROUPS = 64
"""Each costs some calls of OpenGL."""
LEAST_BALLS = 256
"""In a group; fewer are not worth a query."""
_BITS = 5
"""Of a coordinate in the space-filling order."""
_MARGIN_PIXELS = 0.2


@dataclass(frozen=True)
class Groups:
    """Ranges of balls, in order, and where they lie.

    Attributes
    ----------
    starts
        (G + 1,): each group's first ball, and the number of balls.
    low, high
        (G, 3) float64, view space: the box around the influence spheres.
    """

    starts: npt.NDArray[np.int64]
    low: FloatArray
    high: FloatArray

    def corners(self, camera: Camera, depth_scale: float) -> npt.NDArray[np.float32]:
        """(G, 4, 3): a strip of two triangles around each box at the least distance of its points, in normalised device
        coordinates; the depth buffer holds distances times `depth_scale`.
        """
        near, far = -self.high[:, 2], -self.low[:, 2]
        window = camera.window
        sides = []
        for axis, begin, end in ((0, window.left, window.right), (1, window.bottom, window.top)):
            low, high = self.low[:, axis], self.high[:, axis]
            if camera.is_perspective:
                # A box that reaches behind the eye may be anywhere.
                ahead = near > 0
                safe_near, safe_far = np.where(ahead, near, 1), np.where(ahead, far, 1)
                low = np.where(ahead, low / np.where(low < 0, safe_near, safe_far), -np.inf)
                high = np.where(ahead, high / np.where(high > 0, safe_near, safe_far), np.inf)
            margin = _MARGIN_PIXELS * camera.pixel_size[axis]
            sides.append([np.clip(2 * (edge - begin) / (end - begin) - 1, -1, 1) for edge in (low - margin, high + margin)])
        distance = self._least_distance() if camera.is_perspective else near
        depth = np.clip(distance * depth_scale * (1 - 1e-6) * 2 - 1 - 1e-6, -1, 1)
        (left, right), (bottom, top) = sides
        rows = [np.stack([x, y, depth], axis=1) for y in (bottom, top) for x in (left, right)]
        return np.ascontiguousarray(np.stack(rows, axis=1), np.float32)

    def _least_distance(self) -> FloatArray:
        """(G,): of each box from the eye."""
        outside = np.maximum(np.maximum(self.low, -self.high), 0)
        distances: FloatArray = np.linalg.norm(outside, axis=1)
        return distances


def spatial_order(centers: FloatArray) -> npt.NDArray[np.int64]:
    """Indices that put (M, 3) points into the order of a coarse Morton curve through the box around them."""
    low, high = centers.min(axis=0), centers.max(axis=0)
    cells = 2**_BITS
    steps = np.minimum((centers - low) * (cells / np.maximum(high - low, 1e-30)), cells - 1).astype(np.uint16)
    spread = np.array([sum((value >> bit & 1) << 3 * bit for bit in range(_BITS)) for value in range(cells)], np.uint16)
    keys = spread[steps[:, 0]] | spread[steps[:, 1]] << 1 | spread[steps[:, 2]] << 2
    # Sorting 16-bit numbers stably is a radix sort.
    return np.argsort(keys, kind="stable")


def ball_groups(balls: ViewBalls) -> Groups:
    """Groups of equal size along the order of the balls."""
    count = len(balls)
    size = max(LEAST_BALLS, -(-count // MAX_GROUPS))
    starts = np.arange(0, count, size)
    radii = balls.radii[:, None]
    low = np.minimum.reduceat(balls.centers - radii, starts)
    high = np.maximum.reduceat(balls.centers + radii, starts)
    return Groups(np.append(starts, count), low, high)
