"""What OpenEXR files hold, as plain data: headers and channels with the names that Blender gives them. Needs no OpenEXR."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from ... import __version__
from ..fluid.camera import Camera
from ..fluid.deep_image import DeepImage
from ..fluid.errors import InputError
from ..fluid.image import ImageBuffers
from ..fluid.passes import PASSES, Pass

# Lossless ones only: DWA, B44 and PXR24 would change depths, and DWA takes any channel named Y for luminance.
COMPRESSIONS: dict[str, str] = {
    "ZIP": "Deflate, 16 rows at a time; small files",
    "ZIPS": "Deflate, one row at a time; quick to read in parts",
    "PIZ": "Wavelets; smallest for noisy images",
    "RLE": "Run lengths; quick, for images with large empty areas",
    "NONE": "Uncompressed; quickest to write, largest files",
}
"""Names of the compression methods, and what they are good for."""

DEEP_COMPRESSIONS = ("ZIPS", "RLE", "NONE")
"""Those that OpenEXR has for deep images."""

LAYOUTS: dict[str, tuple[str, str]] = {
    "MULTILAYER": ("Multilayer", "One file a frame, all passes in one part: any program reads it"),
    "MULTIPART": ("Multi-Part", "One file a frame, a part for each pass: programs read only what they need; Blender since 4.5"),
    "PASSES": ("Files", "A file for each pass"),
}
"""How passes are put into files: names, what to call them, and what they are."""

HALF_MAX = 65504.0
"""The largest number that a half float holds."""

# EXR's camera space looks along +z and is left-handed; Blender's looks along -z.
_EXR_CAMERA_FROM_VIEW = np.diag([1.0, 1.0, -1.0, 1.0])

# From -1 .. 1 with y up to 0 .. 1 with y down.
_NDC_FROM_CLIP = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])


@dataclass(frozen=True)
class Channel:
    """One channel, not yet as the file holds it: the writer converts it, so that the thread that renders need not wait.

    Attributes
    ----------
    values
        float32 or float16, in any order in memory, row 0 at the top: (height, width), or of a deep image (samples,), pixel
        after pixel.
    is_half
        Whether the file holds half floats.
    """

    values: npt.NDArray[Any]
    is_half: bool = False

    @property
    def dtype(self) -> np.dtype[Any]:
        """What the file holds."""
        return np.dtype(np.float16) if self.is_half else self.values.dtype

    def pixels(self) -> npt.NDArray[Any]:
        """What the file holds, row after row; half floats are clamped to their range."""
        if self.values.dtype == self.dtype:
            return np.ascontiguousarray(self.values)
        pixels = np.array(self.values, order="C")
        np.clip(pixels, -HALF_MAX, HALF_MAX, out=pixels)
        return pixels.astype(self.dtype)


@dataclass(frozen=True)
class ExrPart:
    """One image of a file.

    Attributes
    ----------
    attributes
        Header attributes by name as plain data: numbers, text and lists.
    channels
        By channel name.
    counts
        (height, width) int32: samples of each pixel of a deep image; None for a flat one.
    """

    attributes: dict[str, Any]
    channels: dict[str, Channel]
    counts: npt.NDArray[np.int32] | None = None


@dataclass(frozen=True)
class ExrContent:
    """What one file holds; the parts of several have names."""

    parts: tuple[ExrPart, ...]


@dataclass(frozen=True)
class ExrOptions:
    """How images are laid out in files.

    Attributes
    ----------
    view_layer
        First part of the channel names, as in ``ViewLayer.Depth.Z``.
    compression
        One of :data:`COMPRESSIONS`, all lossless; of a deep image one of :data:`DEEP_COMPRESSIONS`.
    frame
        Frame number, stored as ``imageCounter`` and as ``Frame``, the name that Blender uses.
    frames_per_second
        Stored as a fraction: 23.976 and the like as 24000/1001, others with a denominator of at most 1001.
    is_multipart
        Whether each pass is a part of its own, as Blender 5 writes; programs then read only what they need. Else one part holds
        all channels; Blender before 4.5 reads no other.

    Raises
    ------
    InputError
        The compression is unknown or the view layer has no name.
    """

    view_layer: str = "ViewLayer"
    compression: str = "ZIP"
    frame: int | None = None
    frames_per_second: float | None = None
    is_multipart: bool = False

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            raise InputError(f"Unknown compression '{self.compression}': choose from {', '.join(COMPRESSIONS)}")
        if not self.view_layer:
            raise InputError("The view layer needs a name, which becomes part of the channel names")


def flat_content(image: ImageBuffers, options: ExrOptions = ExrOptions()) -> ExrContent:
    """All passes and mattes of an image, see :func:`exr.write_exr`; its arrays are referred to, not copied."""
    attributes = _attributes(image.camera, options)
    images = {
        f"{options.view_layer}.{PASSES[name].blender_name}": _pass_channels(PASSES[name], values)
        for name, values in image.passes.items()
    }
    if image.cryptomatte is not None:
        attributes |= image.cryptomatte.metadata(options.view_layer)
        for name, layer in image.cryptomatte.layers.items():
            planes = map(Channel, np.moveaxis(layer[::-1], 2, 0))
            images[f"{options.view_layer}.{name}"] = dict(zip("rgba", planes, strict=True))
    parts = {name: {f"{name}.{last}": channel for last, channel in channels.items()} for name, channels in images.items()}
    if options.is_multipart:
        return ExrContent(tuple(ExrPart({**attributes, "name": name}, channels) for name, channels in parts.items()))
    return ExrContent((ExrPart(attributes, {name: values for part in parts.values() for name, values in part.items()}),))


def deep_content(image: DeepImage, options: ExrOptions = ExrOptions(compression="ZIPS")) -> ExrContent:
    """All samples of a deep image, see :func:`exr.write_deep_exr`.

    Raises
    ------
    InputError
        OpenEXR cannot compress deep images so.
    """
    if options.compression not in DEEP_COMPRESSIONS:
        raise InputError(
            f"Deep images cannot be compressed by {options.compression}: choose from {', '.join(DEEP_COMPRESSIONS)}"
        )
    order, counts = _from_the_top(image.counts)
    channels = {
        **{name: Channel(image.rgba[order, index], is_half=True) for index, name in enumerate("RGBA")},
        "Z": Channel(image.enter[order]),
        "ZBack": Channel(image.leave[order]),
        **{f"N.{axis}": Channel(image.normal[order, index]) for index, axis in enumerate("XYZ")},
    }
    return ExrContent((ExrPart(_attributes(image.camera, options), channels, counts),))


def _from_the_top(counts: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """The order of samples (pixel after pixel, row 0 at the bottom) that begins with the top row, and the counts so."""
    rows = counts.sum(axis=1, dtype=np.int64)
    starts = np.concatenate([[0], np.cumsum(rows)[:-1]])
    order = [np.arange(start, start + count) for start, count in zip(starts[::-1], rows[::-1], strict=True)]
    return np.concatenate(order).astype(np.int64), np.ascontiguousarray(counts[::-1])


def _attributes(camera: Camera, options: ExrOptions) -> dict[str, Any]:
    attributes = _camera_attributes(camera)
    attributes["compression"] = options.compression
    attributes["software"] = f"Meniscus {__version__}"
    if options.frame is not None:
        attributes["imageCounter"] = options.frame
        attributes["Frame"] = str(options.frame)
    if options.frames_per_second is not None:
        rate = _frame_rate(options.frames_per_second)
        attributes["framesPerSecond"] = [rate.numerator, rate.denominator]
    return attributes


def _frame_rate(rate: float) -> Fraction:
    """Whole rates and those by 1.001 exactly, although 23.976 or Blender's 24 / 1.001 are only near 24000 / 1001."""
    for denominator in (1, 1001):
        exact = Fraction(round(rate * denominator), denominator)
        if math.isclose(exact, rate, rel_tol=2e-6):
            return exact
    return Fraction(rate).limit_denominator(1001)


def _camera_attributes(camera: Camera) -> dict[str, Any]:
    exr_camera_from_world = _EXR_CAMERA_FROM_VIEW @ camera.view_from_world
    ndc_from_world = _NDC_FROM_CLIP @ camera.clip_from_view @ camera.view_from_world
    whole_image = [[0, 0], [camera.width - 1, camera.height - 1]]
    return {
        "displayWindow": whole_image,
        "dataWindow": whole_image,
        "pixelAspectRatio": float(camera.pixel_aspect),
        # Transposed, because EXR's points are row vectors.
        "worldToCamera": exr_camera_from_world.T.tolist(),
        "worldToNDC": ndc_from_world.T.tolist(),
    }


def _pass_channels(image_pass: Pass, values: npt.NDArray[np.float32]) -> dict[str, Channel]:
    """The channels of one pass by their last names, top row first."""
    planes = values.reshape(*values.shape[:2], len(image_pass.channels))[::-1]
    return {name: Channel(planes[..., index], image_pass.is_color) for index, name in enumerate(image_pass.channels)}
