"""An image that stays on the graphics processor."""

from __future__ import annotations

from dataclasses import dataclass

from ..fluid.camera import Camera
from ..fluid.image import RenderInfo
from .method import DeviceSurface


@dataclass(frozen=True, eq=False)
class DeviceImage:
    """What :class:`image.ImageBuffers` is in the processor's memory.

    Attributes
    ----------
    camera
        What the image shows; it has no region.
    surface
        The passes: depth, normal, and colours where they were asked for and the balls have some.
    info
        How the image came about.
    """

    camera: Camera
    surface: DeviceSurface
    info: RenderInfo
