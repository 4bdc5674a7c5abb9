"""What methods that sample do alike around their passes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace

import moderngl

from ...addon.fluid.camera import Camera, Region
from ...addon.fluid.errors import InputError
from ...addon.fluid.view_balls import ViewBalls, view_balls
from ...addon.render.method import Attribute, MethodInfo, Request, Surface, timed
from ..ball_textures import BALL_TEXTURE_WIDTH, BallDistances, ball_textures
from ..camera_parts import camera_uniforms, image_parts
from ..context import GpuContext
from ..kernel_constants import kernel_textures
from ..surface_textures import SurfaceTextures
from .passes import SamplingWorkspace

MAX_BALLS = BALL_TEXTURE_WIDTH**2
"""They fill a square texture at most."""
_PIXELS_A_PART = 2**20
"""An image of this many pixels takes some 200 MB; a larger one is drawn in parts."""


@dataclass(frozen=True)
class SeenBalls:
    """What meets a view, on the graphics processor.

    Attributes
    ----------
    balls, distances
        The balls, and how far they are from the eye.
    attributes
        What is found beside depth and normal.
    textures
        The balls' own and the kernel's, by sampler name.
    workspace
        What is kept from frame to frame.
    """

    balls: ViewBalls
    distances: BallDistances
    attributes: tuple[Attribute, ...]
    textures: Mapping[str, moderngl.Texture]
    workspace: SamplingWorkspace

    @property
    def summed(self) -> int:
        """How many attributes are summed."""
        return len(self.attributes) - ("ball" in self.attributes)


class SamplingMethod(ABC):
    """A method that samples, on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    info
        What the method is.
    """

    def __init__(self, context: GpuContext, info: MethodInfo) -> None:
        context.require(info.gl_version, 5, BALL_TEXTURE_WIDTH)
        self._context, self._info = context, info
        self._workspace: SamplingWorkspace | None = None

    @abstractmethod
    def draw(
        self, request: Request, seen: SeenBalls, camera: Camera, output: SurfaceTextures, corner: tuple[int, int]
    ) -> dict[str, int]:
        """Draw what `camera` sees, a part of the image, to a corner of `output`; counts of what happened."""

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
        balls = self._seen(request, surface.milliseconds)
        surface.counts["balls_drawn"] = len(balls)
        if len(balls):
            with timed(surface.milliseconds, "surface"):
                self._context.run(lambda: self._draw_and_read(request, balls, surface))
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        milliseconds: dict[str, float] = {}
        self._context.require(self._info.gl_version, texture_size=max(camera.width, camera.height))
        balls = self._seen(request, milliseconds)
        with timed(milliseconds, "surface"):
            textures = self._context.run(lambda: self._draw_on_device(request, balls))
        textures.add_report(milliseconds, {})
        return textures

    def _seen(self, request: Request, milliseconds: dict[str, float]) -> ViewBalls:
        """The balls that meet the view; InputError where they are too many."""
        with timed(milliseconds, "view"):
            balls = view_balls(request.balls, request.camera, request.field)
        if len(balls) > MAX_BALLS:
            raise InputError(
                f"{len(balls)} balls meet the view but {self._info.label} takes at most {MAX_BALLS}; "
                "show fewer, or choose another method"
            )
        return balls

    def _draw_and_read(self, request: Request, balls: ViewBalls, surface: Surface) -> None:
        """Fill `surface` part by part; on the context's thread."""
        seen = self._uploaded(request, balls)
        for region in self._parts(request):
            part = replace(request.camera, region=region).cropped()
            textures = SurfaceTextures(self._context, (part.width, part.height), seen.attributes)
            textures.add_report({}, self.draw(request, seen, part, textures, (0, 0)))
            textures.read_into(surface, region)

    def _draw_on_device(self, request: Request, balls: ViewBalls) -> SurfaceTextures:
        """Draw all parts into one; on the context's thread."""
        camera = request.camera
        textures = SurfaceTextures(self._context, (camera.width, camera.height), request.known_attributes)
        if len(balls):
            seen = self._uploaded(request, balls)
            for region in self._parts(request):
                part = replace(camera, region=region).cropped()
                corner = region.x_min, region.y_min
                textures.add_report({}, self.draw(request, seen, part, textures, corner))
        else:
            textures.clear()
        textures.add_report({}, {"balls_drawn": len(balls)})
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures

    def _uploaded(self, request: Request, balls: ViewBalls) -> SeenBalls:
        self._workspace = self._workspace or SamplingWorkspace(self._context)
        attributes = request.known_attributes
        gl = self._context.gl
        textures = {
            **ball_textures(gl, balls, attributes, request.balls.velocities),
            **kernel_textures(gl, request.field.density_kernel),
        }
        return SeenBalls(balls, BallDistances.measure(balls, request.camera), attributes, textures, self._workspace)

    def _parts(self, request: Request) -> list[Region]:
        longest = min(self._context.limits.texture_size, self._context.limits.viewport_size)
        return list(image_parts(request.camera, _PIXELS_A_PART, longest))


def sampling_uniforms(request: Request, seen: SeenBalls, camera: Camera) -> dict[str, object]:
    """What the shaders of lib/sampling/ ask of a part of the image."""
    return {
        **camera_uniforms(camera),
        "threshold": request.field.threshold,
        "depth_scale": seen.distances.depth_scale,
    }
