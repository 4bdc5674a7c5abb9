"""The camera: which ray each pixel looks along."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .errors import InputError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Window:
    """The image rectangle in view space: on the plane z = -1 (perspective) or in Blender units (orthographic)."""

    left: float
    right: float
    bottom: float
    top: float


@dataclass(frozen=True)
class Region:
    """The pixels to render, in the image's pixels from its lower left; maxima are exclusive (a render border)."""

    x_min: int
    y_min: int
    x_max: int
    y_max: int

    @property
    def width(self) -> int:
        """Columns of the region."""
        return self.x_max - self.x_min

    @property
    def height(self) -> int:
        """Rows of the region."""
        return self.y_max - self.y_min


@dataclass(frozen=True)
class Camera:
    """A perspective or orthographic camera that looks along -z of its view space, y up, as Blender's do.

    Attributes
    ----------
    world_from_view
        (4, 4) float64, a rigid transform.
    window
        What the image shows; holds field of view, lens shift, sensor fit and pixel aspect.
    is_perspective
        Whether rays start in one point (else they are parallel).
    width, height
        Size of the whole image, pixels.
    clip_start, clip_end
        Planar distances between which the surface is looked for, Blender units.
    pixel_aspect
        Width of a pixel by its height, for file headers; `window` already holds it.
    region
        The pixels to render; None for all.

    Raises
    ------
    InputError
        A number is unusable.
    """

    world_from_view: FloatArray
    window: Window
    is_perspective: bool
    width: int
    height: int
    clip_start: float
    clip_end: float
    pixel_aspect: float = 1.0
    region: Region | None = None

    def __post_init__(self) -> None:
        transform = np.array(self.world_from_view, np.float64)
        if transform.shape != (4, 4) or not np.all(np.isfinite(transform)):
            raise InputError("The camera's transform must be a finite 4 x 4 matrix")
        transform.flags.writeable = False
        object.__setattr__(self, "world_from_view", transform)
        if self.width < 1 or self.height < 1:
            raise InputError(f"The image must have at least one pixel, not {self.width} x {self.height}")
        if not 0 <= self.clip_start < self.clip_end < math.inf:
            raise InputError(
                f"The camera's clip start ({self.clip_start}) must be at least 0 and less than its clip end ({self.clip_end})"
            )
        edges = (self.window.left, self.window.right, self.window.bottom, self.window.top)
        if not all(map(math.isfinite, edges)) or edges[0] >= edges[1] or edges[2] >= edges[3]:
            raise InputError("The camera shows an empty rectangle; check its lens, scale and sensor size")
        region = self.region
        if region and not (0 <= region.x_min < region.x_max <= self.width and 0 <= region.y_min < region.y_max <= self.height):
            raise InputError("The render region must hold at least one pixel and lie inside the image")

    @classmethod
    def perspective(
        cls,
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        up: npt.ArrayLike = (0, 0, 1),
        fov_y: float = 0.7,
        width: int = 640,
        height: int = 480,
        clip_start: float = 0.1,
        clip_end: float = 1000.0,
    ) -> Camera:
        """A perspective camera at `eye` that looks at `target` (world space); `fov_y` is the vertical angle in radians."""
        if not 0 < fov_y < math.pi:
            raise InputError(f"The field of view must be between 0 and pi radians, not {fov_y}")
        window = _centred_window(2 * math.tan(fov_y / 2), width, height)
        return cls(_look_at(eye, target, up), window, True, width, height, clip_start, clip_end)

    @classmethod
    def orthographic(
        cls,
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        up: npt.ArrayLike = (0, 0, 1),
        scale: float = 2.0,
        width: int = 640,
        height: int = 480,
        clip_start: float = 0.1,
        clip_end: float = 1000.0,
    ) -> Camera:
        """An orthographic camera at `eye` that looks towards `target` (world space); `scale` is the view's height."""
        if not 0 < scale < math.inf:
            raise InputError(f"The orthographic scale must be greater than 0, not {scale}")
        return cls(_look_at(eye, target, up), _centred_window(scale, width, height), False, width, height, clip_start, clip_end)

    @property
    def eye(self) -> FloatArray:
        """(3,) world space: where the camera is."""
        return self.world_from_view[:3, 3]

    @property
    def view_from_world(self) -> FloatArray:
        """(4, 4), the inverse of `world_from_view`."""
        return np.linalg.inv(self.world_from_view).astype(np.float64, copy=False)

    @property
    def pixel_size(self) -> tuple[float, float]:
        """Width and height of a pixel in units of `window`."""
        window = self.window
        return (window.right - window.left) / self.width, (window.top - window.bottom) / self.height

    @property
    def active_region(self) -> Region:
        """`region`, or the whole image."""
        return self.region or Region(0, 0, self.width, self.height)

    @property
    def clip_from_view(self) -> FloatArray:
        """(4, 4) OpenGL projection: normalized device coordinates -1 at the left, the bottom and the near plane."""
        window, near, far = self.window, self.clip_start, self.clip_end
        width, height = window.right - window.left, window.top - window.bottom
        middle = ((window.right + window.left) / width, (window.top + window.bottom) / height)
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = 2 / width, 2 / height
        if self.is_perspective:
            matrix[:2, 2] = middle
            matrix[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
            matrix[3, 2] = -1
        else:
            matrix[:2, 3] = -middle[0], -middle[1]
            matrix[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
            matrix[3, 3] = 1
        return matrix

    def cropped(self) -> Camera:
        """The camera whose whole image is this one's region."""
        region = self.active_region
        pixel_width, pixel_height = self.pixel_size
        window = Window(
            self.window.left + region.x_min * pixel_width,
            self.window.left + region.x_max * pixel_width,
            self.window.bottom + region.y_min * pixel_height,
            self.window.bottom + region.y_max * pixel_height,
        )
        return replace(self, window=window, width=region.width, height=region.height, region=None)

    def resized(self, width: int, height: int) -> Camera:
        """The same view in another number of pixels; this camera has no region."""
        return replace(self, width=width, height=height)

    def shifted(self, x: float, y: float) -> Camera:
        """The same view with all rays moved by a part of a pixel, for antialiasing."""
        pixel_width, pixel_height = self.pixel_size
        left, bottom = x * pixel_width, y * pixel_height
        window = Window(
            self.window.left + left, self.window.right + left, self.window.bottom + bottom, self.window.top + bottom
        )
        return replace(self, window=window)

    def is_same(self, other: Camera) -> bool:
        """Whether both show the same in the same pixels."""
        mine, theirs = ({**vars(camera), "world_from_view": None} for camera in (self, other))
        return mine == theirs and np.array_equal(self.world_from_view, other.world_from_view)

    def depth_range(self, bounds: FloatArray) -> tuple[float, float]:
        """The least and the greatest planar depth in a box (2, 3) of world space; the nearest is not below 0."""
        axis = -self.world_from_view[:3, 2]
        reach = (bounds - self.eye) * axis
        return max(float(reach.min(axis=0).sum()), 0.0), max(float(reach.max(axis=0).sum()), 0.0)

    def region_of(self, bounds: FloatArray) -> Region | None:
        """The pixels that may see something of a box (2, 3) of world space; None where none does. Of the whole image."""
        corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), -1).reshape(-1, 3)
        in_view = (corners - self.eye) @ self.world_from_view[:3, :3]
        depth = -in_view[:, 2]
        if depth.max() <= self.clip_start or depth.min() >= self.clip_end:
            return None
        if self.is_perspective and depth.min() <= max(self.clip_start, 1e-6 * depth.max()):
            # A corner beside or behind the eye is seen nowhere, and yet the box may reach across the image.
            return Region(0, 0, self.width, self.height)
        places = in_view[:, :2] / depth[:, None] if self.is_perspective else in_view[:, :2]
        pixels = (places - (self.window.left, self.window.bottom)) / self.pixel_size
        x_min, y_min = np.maximum(np.floor(pixels.min(axis=0)) - 1, 0)
        x_max, y_max = np.minimum(np.ceil(pixels.max(axis=0)) + 1, (self.width, self.height))
        return Region(int(x_min), int(y_min), int(x_max), int(y_max)) if x_min < x_max and y_min < y_max else None

    def pixel_centers(self) -> tuple[FloatArray, FloatArray]:
        """Where the region's columns and rows of pixels lie in the window: (width,) and (height,)."""
        region, (pixel_width, pixel_height) = self.active_region, self.pixel_size
        x = self.window.left + (np.arange(region.x_min, region.x_max) + 0.5) * pixel_width
        y = self.window.bottom + (np.arange(region.y_min, region.y_max) + 0.5) * pixel_height
        return x.astype(np.float64, copy=False), y.astype(np.float64, copy=False)

    def view_rays(self) -> tuple[FloatArray, FloatArray]:
        """Rays through the pixel centres of the region, in view space.

        Returns
        -------
        origins, directions : (height, width, 3) of the region, row 0 at the bottom. Directions are not unit but have
        z = -1, so the distance along them is planar depth.
        """
        x, y = self.pixel_centers()
        plane = np.zeros((len(y), len(x), 3))
        plane[..., 0], plane[..., 1] = x, y[:, None]
        forward = np.broadcast_to(np.array([0.0, 0.0, -1.0]), plane.shape)
        return (np.zeros_like(plane), plane + forward) if self.is_perspective else (plane, forward.copy())


def _centred_window(height: float, pixels_x: int, pixels_y: int) -> Window:
    if pixels_x < 1 or pixels_y < 1:
        raise InputError(f"The image must have at least one pixel, not {pixels_x} x {pixels_y}")
    half_y = height / 2
    half_x = half_y * pixels_x / pixels_y
    return Window(-half_x, half_x, -half_y, half_y)


def _look_at(eye: npt.ArrayLike, target: npt.ArrayLike, up: npt.ArrayLike) -> FloatArray:
    eye_point = np.asarray(eye, np.float64)
    backward = eye_point - np.asarray(target, np.float64)
    right = np.cross(np.asarray(up, np.float64), backward)
    lengths = np.linalg.norm(backward), np.linalg.norm(right)
    if not all(length > 0 and math.isfinite(length) for length in lengths):
        raise InputError("The camera needs an eye that differs from its target, and an up direction across its view")
    backward, right = backward / lengths[0], right / lengths[1]
    transform = np.eye(4)
    transform[:3, 0], transform[:3, 1], transform[:3, 2], transform[:3, 3] = (
        right,
        np.cross(backward, right),
        backward,
        eye_point,
    )
    return transform
