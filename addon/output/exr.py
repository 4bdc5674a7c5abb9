"""Flat multilayer OpenEXR files with the layer and channel names that Blender gives them."""

from __future__ import annotations

import io
import math
import os
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from ... import __version__
from ..fluid.camera import Camera
from ..fluid.errors import InputError, OutputError
from ..fluid.image import ImageBuffers
from ..fluid.passes import PASSES, Pass
from .whole_file import whole_file

# Lossless ones only: DWA, B44 and PXR24 would change depths, and DWA takes any channel named Y for luminance.
COMPRESSIONS: dict[str, str] = {
    "ZIP": "Deflate, 16 rows at a time; small files",
    "ZIPS": "Deflate, one row at a time; quick to read in parts",
    "PIZ": "Wavelets; smallest for noisy images",
    "RLE": "Run lengths; quick, for images with large empty areas",
    "NONE": "Uncompressed; quickest to write, largest files",
}
"""Names of the compression methods, and what they are good for."""

HALF_MAX = 65504.0
"""The largest number that a half float holds."""

# EXR's camera space looks along +z and is left-handed; Blender's looks along -z.
_EXR_CAMERA_FROM_VIEW = np.diag([1.0, 1.0, -1.0, 1.0])

# From -1 .. 1 with y up to 0 .. 1 with y down.
_NDC_FROM_CLIP = np.array([[0.5, 0, 0, 0.5], [0, -0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])


@dataclass(frozen=True)
class ExrContent:
    """What one file holds.

    Attributes
    ----------
    attributes
        Header attributes by name as plain data: numbers, text and lists.
    channels
        (height, width) float16 or float32 by channel name, row 0 at the top.
    """

    attributes: dict[str, Any]
    channels: dict[str, npt.NDArray[Any]]


def write_exr(
    path: str | os.PathLike[str],
    image: ImageBuffers,
    *,
    view_layer: str = "ViewLayer",
    compression: str = "ZIP",
    frame: int | None = None,
    frames_per_second: float | None = None,
) -> None:
    """Write all passes of `image` to one multilayer EXR file, which replaces `path` only when it is whole.

    Parameters
    ----------
    path
        The file; missing folders are made.
    image
        Its data passes are stored as 32-bit floats, bit for bit. Colour passes are stored as half floats: rounded to 11
        significant bits, and clamped to +-65504.
    view_layer
        First part of the channel names, as in ``ViewLayer.Depth.Z``.
    compression
        One of :data:`COMPRESSIONS`, all lossless.
    frame
        Frame number, stored as ``imageCounter`` and as ``Frame``, the name that Blender uses.
    frames_per_second
        Stored as a fraction: 23.976 and the like as 24000/1001, others with a denominator of at most 1001.

    Notes
    -----
    ``worldToCamera`` and ``worldToNDC`` follow the OpenEXR standard attributes, that is RenderMan: a point is a row
    vector, ``p_camera = p_world M``. Camera space is left-handed: x right, y up, z forward. In NDC, after the division by
    w, (0, 0) is the upper left corner of the image and (1, 1) the lower right one; z is 0 at the clip start and 1 at
    the clip end.

    Display and data window are both the whole image even when only a region was rendered: Blender places a smaller data
    window wrongly. Outside the region lies the passes' background.

    Raises
    ------
    InputError
        The compression is unknown or the view layer has no name.
    OutputError
        The file cannot be written.
    """
    content = exr_content(
        image, view_layer=view_layer, compression=compression, frame=frame, frames_per_second=frames_per_second
    )
    write_content(path, content)


def exr_content(
    image: ImageBuffers, *, view_layer: str, compression: str, frame: int | None, frames_per_second: float | None
) -> ExrContent:
    """What :func:`write_exr` writes, see there; needs no OpenEXR."""
    if compression not in COMPRESSIONS:
        raise InputError(f"Unknown compression '{compression}': choose from {', '.join(COMPRESSIONS)}")
    if not view_layer:
        raise InputError("The view layer needs a name, which becomes part of the channel names")
    attributes = _camera_attributes(image.camera)
    attributes["compression"] = compression
    attributes["software"] = f"Meniscus {__version__}"
    if frame is not None:
        attributes["imageCounter"] = frame
        attributes["Frame"] = str(frame)
    if frames_per_second is not None:
        rate = _frame_rate(frames_per_second)
        attributes["framesPerSecond"] = [rate.numerator, rate.denominator]
    channels: dict[str, npt.NDArray[Any]] = {}
    for name, values in image.passes.items():
        channels.update(_channels(f"{view_layer}.{PASSES[name].blender_name}", PASSES[name], values))
    return ExrContent(attributes, channels)


def _frame_rate(rate: float) -> Fraction:
    """Whole rates and those by 1.001 exactly, although 23.976 or Blender's 24 / 1.001 are only near 24000 / 1001."""
    for denominator in (1, 1001):
        exact = Fraction(round(rate * denominator), denominator)
        if math.isclose(exact, rate, rel_tol=2e-6):
            return exact
    return Fraction(rate).limit_denominator(1001)


def write_content(path: str | os.PathLike[str], content: ExrContent) -> None:
    """Write `content` to `path` through a temporary file, see :func:`write_exr`."""
    encoded = _encoded(content)
    with whole_file(path) as temporary:
        temporary.write_bytes(encoded)


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


def _channels(prefix: str, image_pass: Pass, values: npt.NDArray[np.float32]) -> dict[str, npt.NDArray[Any]]:
    """The channels of one pass, top row first."""
    planes = values.reshape(*values.shape[:2], len(image_pass.channels))[::-1]
    if image_pass.is_color:
        planes = np.clip(planes, -HALF_MAX, HALF_MAX).astype(np.float16)
    return {f"{prefix}.{channel}": np.ascontiguousarray(planes[..., i]) for i, channel in enumerate(image_pass.channels)}


def _encoded(content: ExrContent) -> bytes:
    try:
        import OpenEXR
    except ImportError as error:
        raise OutputError(f"The OpenEXR package cannot be loaded ({error}); install the extension again") from error
    if OpenEXR.global_thread_count() == 0:  # Nobody chose a number; compressing takes longest.
        OpenEXR.set_global_thread_count(os.cpu_count() or 1)
    stream = io.BytesIO()
    try:
        # The file object changes the dictionary it is given, hence the copy.
        with OpenEXR.File(_header(content.attributes), dict(content.channels)) as file:
            file.write(stream)
    except (RuntimeError, ValueError, TypeError) as error:
        raise OutputError(f"The image cannot be encoded as EXR: {error}") from error
    return stream.getvalue()


def _header(attributes: dict[str, Any]) -> dict[str, Any]:
    """`attributes` in OpenEXR's own types."""
    import OpenEXR

    header = dict(attributes)
    header["type"] = OpenEXR.scanlineimage
    compression = header["compression"]
    header["compression"] = getattr(OpenEXR, f"{'NO' if compression == 'NONE' else compression}_COMPRESSION")
    for name in ("displayWindow", "dataWindow"):
        header[name] = tuple(np.array(corner, np.int32) for corner in header[name])
    for name in ("worldToCamera", "worldToNDC"):
        header[name] = np.array(header[name], np.float32)
    if "framesPerSecond" in header:
        header["framesPerSecond"] = Fraction(*header["framesPerSecond"])
    return header
