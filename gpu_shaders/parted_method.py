"""What methods that fill the textures of an image part by part do alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar, Generic, TypeVar

from ..addon.fluid.camera import Camera, Region
from ..addon.fluid.errors import MeniscusError
from ..addon.render.method import MethodInfo, Request, Surface, timed
from .camera_parts import image_parts
from .context import GpuContext
from .surface_textures import SurfaceTextures

Scene = TypeVar("Scene")
Result = TypeVar("Result")


class PartedMethod(ABC, Generic[Scene]):
    """A method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    info
        What the method is.

    Attributes
    ----------
    pixels_a_part
        A larger image is read back in parts.
    """

    pixels_a_part: ClassVar[int] = 2**23

    def __init__(self, context: GpuContext, info: MethodInfo) -> None:
        self._context, self._info = context, info

    @abstractmethod
    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> Scene | None:
        """What is to be drawn, made on the calling thread, None for nothing; notes how long that took by stage."""

    @abstractmethod
    def fill(self, request: Request, scene: Scene, camera: Camera, textures: SurfaceTextures) -> None:
        """Fill the textures with what `camera` sees, the image or a part of it; on the context's thread."""

    def counts_of(self, scene: Scene) -> Mapping[str, int]:
        """What there is to count of what is drawn."""
        return {}

    def notes_of(self, scene: Scene) -> tuple[str, ...]:
        """What users should know of what is drawn, in sentences."""
        return ()

    def forget(self) -> None:
        """Give back what is kept, after an error: the driver may have refused the memory."""

    @property
    def device(self) -> str:
        """What the driver calls the graphics processor."""
        return str(self._context.renderer)

    @property
    def shares_textures(self) -> bool:
        """See :meth:`method.DeviceMethod.shares_textures`."""
        return self._context.shares

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        surface = Surface.background(request.camera, request.known_attributes)
        scene = self.scene_of(request, surface.milliseconds)
        if scene is not None:
            limits = self._context.limits
            longest = min(limits.texture_size, limits.viewport_size)
            with timed(surface.milliseconds, "surface"):
                for region in image_parts(request.camera, self.pixels_a_part, longest):
                    request.watch(region.y_min / request.camera.height)
                    self._run(partial(self._fill_part, request, scene, region, surface))
            surface.counts |= self.counts_of(scene)
            surface.notes = self.notes_of(scene)
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        milliseconds: dict[str, float] = {}
        self._context.require(self._info.gl_version, texture_size=max(camera.width, camera.height))
        scene = self.scene_of(request, milliseconds)
        with timed(milliseconds, "surface"):
            textures = self._run(lambda: self._fill_on_device(request, scene))
        textures.milliseconds |= milliseconds
        if scene is not None:
            textures.counts |= self.counts_of(scene)
            textures.notes = self.notes_of(scene)
        return textures

    def _run(self, work: Callable[[], Result]) -> Result:
        try:
            return self._context.run(work)
        except MeniscusError:
            self.forget()
            raise

    def _fill_part(self, request: Request, scene: Scene, region: Region, surface: Surface) -> None:
        camera = replace(request.camera, region=region).cropped()
        textures = SurfaceTextures(self._context, (camera.width, camera.height), request.known_attributes)
        self.fill(request, scene, camera, textures)
        textures.read_into(surface, region)

    def _fill_on_device(self, request: Request, scene: Scene | None) -> SurfaceTextures:
        camera = request.camera
        textures = SurfaceTextures(self._context, (camera.width, camera.height), request.known_attributes)
        if scene is None:
            textures.clear()
        else:
            self.fill(request, scene, camera, textures)
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures
