"""Deep images: several samples in depth a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .camera import Camera
from .image import RenderInfo


@dataclass(frozen=True)
class DeepImage:
    """The spans of each ray in a fluid as samples, pixel after pixel, row 0 at the bottom; in a pixel the nearest first.

    Attributes
    ----------
    camera
        What the image shows.
    counts
        (height, width) int32: samples of each pixel of the whole image.
    enter, leave
        (samples,) float32: planar depths, Blender units. Samples of a pixel do not overlap.
    rgba
        (samples, 4) float32: linear Rec.709, premultiplied alpha. Within a sample the fluid takes light away evenly, so that a
        sample may be parted as OpenEXR's conventions for volume samples say.
    normal
        (samples, 3) float32: where the ray enters, unit, world space; 0 where it begins in the fluid.
    info
        How the image came about.
    """

    camera: Camera
    counts: npt.NDArray[np.int32]
    enter: npt.NDArray[np.float32]
    leave: npt.NDArray[np.float32]
    rgba: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    info: RenderInfo
