"""Images that go from the methods' OpenGL context to Blender's without leaving the graphics processor.

Where Blender runs on OpenGL with hardware, the process's context can share its objects with Blender's. A surface is then copied
from texture to texture on the card, and Blender's gpu module draws it as it draws any other. Where that
cannot be, or fails, images come through the processor's memory.
"""

from __future__ import annotations

import gpu
import numpy as np
import numpy.typing as npt

from ..fluid.errors import DeviceError
from ..fluid.image import ImageBuffers
from ..render.device_image import DeviceImage
from ..render.registry import gpu as opengl

Textures = dict[str, gpu.types.GPUTexture]

_NOT_TRIED = "Images come through the processor's memory"


class TextureSharing:
    """Whether the methods' OpenGL context shares its textures with Blender's.

    Attributes
    ----------
    problem
        One sentence that says why not, for the statistics; empty where it does.
    """

    def __init__(self) -> None:
        self.problem = _NOT_TRIED
        self._is_begun = self._has_failed = False

    def begin(self) -> None:
        """Share from now on where it can be; to be called in a draw handler, each time, before images are asked for."""
        if self._has_failed or not _is_worthwhile():
            return
        try:
            opengl().share_with_current_context()
            self._is_begun, self.problem = True, ""
        except DeviceError as error:
            self.give_up(error)

    def give_up(self, error: DeviceError) -> None:
        """Share no more until the next start, because it failed."""
        self._has_failed, self.problem = True, f"{_NOT_TRIED}: {error}"
        if self._is_begun:
            opengl().stop_sharing()

    def end(self) -> None:
        """Share no more; to be called before Blender gives up its contexts, when nothing is rendered any more."""
        if self._is_begun:
            opengl().close_context()
        self._is_begun = self._has_failed = False
        self.problem = _NOT_TRIED


SHARING = TextureSharing()
"""Of all viewports."""


def _is_worthwhile() -> bool:
    """Whether there is an OpenGL context to share with, on a card; to software a copy is a copy."""
    return gpu.platform.backend_type_get() == "OPENGL" and gpu.platform.device_type_get() != "SOFTWARE"


def textures_of(image: ImageBuffers | DeviceImage) -> Textures:
    """Depth (R32F), normal and colours (RGBA32F) of an image as Blender's textures, by pass name; in a draw handler.

    An image on the graphics processor is given back there, and can be asked for once.
    """
    if isinstance(image, ImageBuffers):
        return {name: uploaded(pixels) for name, pixels in image.passes.items()}
    surface = image.surface
    try:
        textures = {name: gpu.types.GPUTexture(surface.size, format=_format(name == "depth")) for name in surface.passes}
        with gpu.types.GPUFrameBuffer(color_slots=list(textures.values())).bind():
            surface.copy_to_attachments()
    except DeviceError as error:
        textures = {name: uploaded(pixels) for name, pixels in surface.read_back().items()}
        SHARING.give_up(error)
    surface.release()
    return textures


def uploaded(pixels: npt.NDArray[np.float32]) -> gpu.types.GPUTexture:
    """(height, width), (height, width, 3) or (height, width, 4) as a texture."""
    height, width = pixels.shape[:2]
    if pixels.ndim == 3 and pixels.shape[2] == 3:
        padded = np.ones((height, width, 4), np.float32)
        padded[..., :3] = pixels
        pixels = padded
    data = gpu.types.Buffer("FLOAT", pixels.size, np.ascontiguousarray(pixels).reshape(-1))
    return gpu.types.GPUTexture((width, height), format=_format(pixels.ndim == 2), data=data)


def _format(is_scalar: bool) -> str:
    return "R32F" if is_scalar else "RGBA32F"
