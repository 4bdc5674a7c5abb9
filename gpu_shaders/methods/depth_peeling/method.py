"""Runs the shaders of Depth Peeling; see the package for what it does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.errors import InputError
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.fluid.view_balls import ViewBalls, view_balls
from ....addon.render.method import Attribute, Request, Surface, timed
from ...ball_textures import BALL_TEXTURE_WIDTH, BallDistances, ball_textures
from ...camera_parts import image_parts
from ...context import GpuContext, shared_context
from ...surface_textures import SurfaceTextures
from .balls import frame_uniforms, in_spatial_order
from .frame import Frame
from .groups import Groups, ball_groups
from .options import Options
from .params import MAX_BALLS, METHOD
from .programs import LIST_LENGTH, LIST_TARGETS, Variant
from .targets import Workspace

# An image of this many pixels takes some 250 MB; a larger one is drawn in parts.
_PIXELS_A_PART = 2**20


class DepthPeeling:
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    options
        Which optimisations to use.
    list_length
        Balls that a ray may be in before it goes on without a list, 1 to 14.
    """

    def __init__(self, context: GpuContext, options: Options | None = None, list_length: int = LIST_LENGTH) -> None:
        self._options = options or Options()
        # The balls fill a square texture at most.
        context.require(METHOD.gl_version, LIST_TARGETS + self._options.diagnostics, BALL_TEXTURE_WIDTH)
        self._context = context
        self._list_length = list_length
        self._workspace: Workspace | None = None

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
        seen = self._seen(request)
        surface = _empty(request.camera, seen.with_colors)
        surface.counts["balls_drawn"] = len(seen.balls)
        if len(seen.balls):
            with timed(seen.milliseconds, "surface"):
                self._context.run(lambda: self._draw_and_read(seen, request, surface))
        surface.milliseconds = seen.milliseconds
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        self._context.require(METHOD.gl_version, texture_size=max(camera.width, camera.height))
        seen = self._seen(request)
        with timed(seen.milliseconds, "surface"):
            textures = self._context.run(lambda: self._draw_on_device(seen, request))
        textures.milliseconds = seen.milliseconds
        return textures

    def _seen(self, request: Request) -> _Seen:
        """What is to be drawn; InputError where it is too much."""
        milliseconds: dict[str, float] = {}
        with timed(milliseconds, "view"):
            balls = view_balls(request.balls, request.camera, request.field)
        if len(balls) > MAX_BALLS:
            raise InputError(
                f"{len(balls)} balls meet the view but {METHOD.label} takes at most {MAX_BALLS}; "
                "show fewer, or choose another method"
            )
        groups = None
        if len(balls):
            with timed(milliseconds, "groups"):
                balls, groups = self._grouped(balls)
        return _Seen(balls, groups, "color" in request.attributes and balls.colors is not None, milliseconds)

    def _grouped(self, balls: ViewBalls) -> tuple[ViewBalls, Groups | None]:
        """The balls in an order in which groups of them lie together, and the groups if they are to be asked for."""
        if not (self._options.group_queries and self._options.kernel_spheres):
            return balls, None
        balls = in_spatial_order(balls)
        return balls, ball_groups(balls)

    def _draw_and_read(self, seen: _Seen, request: Request, surface: Surface) -> None:
        """Fill `surface` part by part; on the context's thread."""
        drawing = self._drawing(seen, request)
        for region in self._parts(request.camera):
            rows, columns = slice(region.y_min, region.y_max), slice(region.x_min, region.x_max)
            size = region.x_max - region.x_min, region.y_max - region.y_min
            textures = SurfaceTextures(self._context, size, seen.attributes)
            _add(surface.counts, drawing.draw(region, textures, (0, 0)))
            surface.depth[rows, columns] = textures.read("depth")
            surface.normal[rows, columns] = textures.read("normal")
            if surface.color is not None:
                surface.color[rows, columns] = textures.read("color")

    def _draw_on_device(self, seen: _Seen, request: Request) -> SurfaceTextures:
        """Draw all parts into one; on the context's thread."""
        camera = request.camera
        textures = SurfaceTextures(self._context, (camera.width, camera.height), seen.attributes)
        textures.counts["balls_drawn"] = len(seen.balls)
        if len(seen.balls):
            drawing = self._drawing(seen, request)
            for region in self._parts(camera):
                _add(textures.counts, drawing.draw(region, textures, (region.x_min, region.y_min)))
        else:
            textures.clear()
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures

    def _drawing(self, seen: _Seen, request: Request) -> _Drawing:
        self._workspace = self._workspace or Workspace(self._context)
        return _Drawing(self._context, self._workspace, seen, request, self._options, self._list_length)

    def _parts(self, camera: Camera) -> Iterator[Region]:
        longest_side = min(self._context.limits.texture_size, self._context.limits.viewport_size)
        return image_parts(camera, _PIXELS_A_PART, longest_side)


@dataclass(frozen=True)
class _Seen:
    """What meets a view: the balls, their groups if they are to be asked for, and how long finding them took."""

    balls: ViewBalls
    groups: Groups | None
    with_colors: bool
    milliseconds: dict[str, float]

    @property
    def attributes(self) -> tuple[Attribute, ...]:
        """What is found beside depth and normal."""
        return ("color",) if self.with_colors else ()


class _Drawing:
    """Draws parts of an image; made and used on the context's thread."""

    def __init__(
        self, context: GpuContext, workspace: Workspace, seen: _Seen, request: Request, options: Options, list_length: int
    ) -> None:
        self._context, self._workspace = context, workspace
        self._seen, self._request = seen, request
        self._distances = distances = BallDistances.measure(seen.balls, request.camera)
        self._variant = Variant(
            request.field.polynomial_kernel,
            options,
            list_length,
            with_colors=seen.with_colors,
            with_starts=distances.with_starts,
        )
        self._textures = ball_textures(context.gl, seen.balls, seen.attributes)

    def draw(self, region: Region, output: SurfaceTextures, corner: tuple[int, int]) -> dict[str, int]:
        """Draw the region to a corner of `output`; counts of what happened."""
        balls, groups, request = self._seen.balls, self._seen.groups, self._request
        part = replace(request.camera, region=region).cropped()
        check_cancelled = partial(request.watch, region.y_min / request.camera.height)
        frame = Frame(self._context, self._workspace, (part.width, part.height), self._variant, len(balls), check_cancelled)
        frame.bind(self._textures, frame_uniforms(balls, self._distances, part, request.field))
        starts = np.array([0, len(balls)]) if groups is None else groups.starts
        corners = None if groups is None else groups.corners(part, self._distances.depth_scale)
        return frame.draw(starts, corners, output, corner)


def create() -> DepthPeeling:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(DepthPeeling)


def _add(counts: dict[str, int], more: dict[str, int]) -> None:
    for name, count in more.items():
        counts[name] = counts.get(name, 0) + count


def _empty(camera: Camera, with_color: bool) -> Surface:
    """The surface of nothing, to be filled."""
    shape = (camera.height, camera.width)
    color = np.zeros((*shape, 3), np.float32) if with_color else None
    return Surface(np.full(shape, DEPTH_BACKGROUND, np.float32), np.zeros((*shape, 3), np.float32), color)
