"""OpenEXR files: flat multilayer ones with the layer and channel names that Blender gives them, and deep ones."""

from __future__ import annotations

import io
import os
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..fluid.deep_image import DeepImage
from ..fluid.errors import OutputError
from ..fluid.image import ImageBuffers
from .exr_content import ExrContent, ExrOptions, ExrPart, deep_content, flat_content
from .whole_file import whole_file


def write_exr(
    path: str | os.PathLike[str],
    image: ImageBuffers,
    *,
    view_layer: str = "ViewLayer",
    compression: str = "ZIP",
    frame: int | None = None,
    frames_per_second: float | None = None,
    is_multipart: bool = False,
) -> None:
    """Write all passes and mattes of `image` to one multilayer EXR file, which replaces `path` only when it is whole.

    Parameters
    ----------
    path
        The file; missing folders are made.
    image
        Its data passes are stored as 32-bit floats, bit for bit. Colour passes are stored as half floats: rounded to 11
        significant bits, and clamped to +-65504.
    view_layer, compression, frame, frames_per_second, is_multipart
        See :class:`exr_content.ExrOptions`.

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
    options = ExrOptions(view_layer, compression, frame, frames_per_second, is_multipart)
    write_content(path, flat_content(image, options))


def write_deep_exr(
    path: str | os.PathLike[str],
    image: DeepImage,
    *,
    compression: str = "ZIPS",
    frame: int | None = None,
    frames_per_second: float | None = None,
) -> None:
    """Write a deep image to an EXR file, which replaces `path` only when it is whole.

    The file follows OpenEXR's conventions for deep pixels and is tidy: the samples of a pixel are in order of depth and do not
    overlap. ``Z`` and ``ZBack`` (float) are planar depths, as in the Depth pass; ``R``, ``G``, ``B``, ``A`` (half) are
    premultiplied; ``N.X``, ``N.Y``, ``N.Z`` (float) is the normal where the ray enters, world space.

    Parameters
    ----------
    path
        The file; missing folders are made.
    image
        What :func:`deep.render_deep` gives.
    compression, frame, frames_per_second
        See :class:`exr_content.ExrOptions`.

    Raises
    ------
    InputError
        OpenEXR cannot compress deep images so.
    OutputError
        The file cannot be written.
    """
    options = ExrOptions(compression=compression, frame=frame, frames_per_second=frames_per_second)
    write_content(path, deep_content(image, options))


class EncodingMemory(io.BytesIO):
    """Where a file is encoded; used again for the next file, it needs no fresh memory from the system."""

    _end = 0

    def write(self, data: Any, /) -> int:
        """Put `data` where the encoder is, which goes back to the head in the end."""
        count = super().write(data)
        self._end = max(self._end, self.tell())
        return count

    def restart(self) -> None:
        """Begin another file."""
        self.seek(0)
        self._end = 0

    def save(self, path: Path) -> None:
        """Write what was encoded to `path`."""
        with path.open("wb") as file, self.getbuffer() as memory, memory[: self._end] as encoded:
            file.write(encoded)


def write_content(path: str | os.PathLike[str], content: ExrContent, memory: EncodingMemory | None = None) -> None:
    """Write `content` to `path` through a temporary file, see :func:`write_exr`."""
    memory = memory or EncodingMemory()
    memory.restart()
    _encode(content, memory)
    with whole_file(path) as temporary:
        memory.save(temporary)


def _encode(content: ExrContent, memory: EncodingMemory) -> None:
    try:
        import OpenEXR
    except ImportError as error:
        raise OutputError(f"The OpenEXR package cannot be loaded ({error}); install the extension again") from error
    if OpenEXR.global_thread_count() == 0:  # Nobody chose a number; compressing takes longest.
        OpenEXR.set_global_thread_count(os.cpu_count() or 1)
    try:
        with _file(content) as file:
            file.write(memory)
    except (RuntimeError, ValueError, TypeError) as error:
        raise OutputError(f"The image cannot be encoded as EXR: {error}") from error


def _file(content: ExrContent) -> Any:
    """An `OpenEXR.File`."""
    import OpenEXR

    # The file object changes the dictionaries it is given.
    headers = [_header(part) for part in content.parts]
    channels = [_channels(part) for part in content.parts]
    if len(content.parts) == 1:
        return OpenEXR.File(headers[0], channels[0])
    names = [header.pop("name") for header in headers]
    return OpenEXR.File([OpenEXR.Part(*part) for part in zip(headers, channels, names, strict=True)])


def _header(part: ExrPart) -> dict[str, Any]:
    """The attributes in OpenEXR's own types."""
    import OpenEXR

    header = dict(part.attributes)
    header["type"] = OpenEXR.scanlineimage if part.counts is None else OpenEXR.deepscanline
    compression = header["compression"]
    header["compression"] = getattr(OpenEXR, f"{'NO' if compression == 'NONE' else compression}_COMPRESSION")
    for name in ("displayWindow", "dataWindow"):
        header[name] = tuple(np.array(corner, np.int32) for corner in header[name])
    for name in ("worldToCamera", "worldToNDC"):
        header[name] = np.array(header[name], np.float32)
    if "framesPerSecond" in header:
        header["framesPerSecond"] = Fraction(*header["framesPerSecond"])
    return header


def _channels(part: ExrPart) -> dict[str, npt.NDArray[Any]]:
    """The channels as OpenEXR takes them: of a deep image (height, width) objects, arrays of samples or None."""
    if part.counts is None:
        return {name: channel.pixels() for name, channel in part.channels.items()}
    counts = part.counts.reshape(-1)
    places = np.flatnonzero(counts)
    ends = np.cumsum(counts[places])[:-1]
    channels = {}
    for name, channel in part.channels.items():
        values = channel.pixels()
        pixels = np.full(counts.shape, None, object)
        pixels[0] = values[:0]  # tells the type where there is no sample at all
        if len(places):
            pixels[places] = np.fromiter(np.split(values, ends), object, len(places))
        channels[name] = pixels.reshape(part.counts.shape)
    return channels
