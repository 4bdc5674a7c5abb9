"""Runs the shaders of Depth Peeling; see the package for what it does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.errors import InputError
from ....addon.fluid.passes import DEPTH_BACKGROUND
from ....addon.fluid.view_balls import ViewBalls, view_balls
from ....addon.render.method import Request, Surface, timed
from ...context import GpuContext, shared_context
from .balls import BallDistances, ball_textures, frame_uniforms, in_spatial_order
from .frame import Frame
from .groups import Groups, ball_groups
from .options import Options
from .params import MAX_BALLS, METHOD
from .programs import BALL_TEXTURE_WIDTH, LIST_LENGTH, LIST_TARGETS, Variant
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

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        milliseconds: dict[str, float] = {}
        with timed(milliseconds, "view"):
            balls = view_balls(request.balls, request.camera, request.field)
        if len(balls) > MAX_BALLS:
            raise InputError(
                f"{len(balls)} balls meet the view but {METHOD.label} takes at most {MAX_BALLS}; "
                "show fewer, or choose another method"
            )
        surface = _empty(request.camera, "color" in request.attributes and balls.colors is not None)
        surface.counts = {"balls_drawn": len(balls)}
        if len(balls):
            with timed(milliseconds, "groups"):
                balls, groups = self._grouped(balls)
            with timed(milliseconds, "surface"):
                self._context.run(lambda: self._draw(balls, groups, request, surface))
        surface.milliseconds = milliseconds
        return surface

    def _grouped(self, balls: ViewBalls) -> tuple[ViewBalls, Groups | None]:
        """The balls in an order in which groups of them lie together, and the groups if they are to be asked for."""
        if not (self._options.group_queries and self._options.kernel_spheres):
            return balls, None
        balls = in_spatial_order(balls)
        return balls, ball_groups(balls)

    def _draw(self, balls: ViewBalls, groups: Groups | None, request: Request, surface: Surface) -> None:
        """Fill `surface` part by part; on the context's thread."""
        camera, field = request.camera, request.field
        distances = BallDistances.measure(balls, camera)
        variant = Variant(
            field.density_kernel,
            self._options,
            self._list_length,
            with_colors=surface.color is not None,
            with_starts=distances.with_starts,
        )
        self._workspace = workspace = self._workspace or Workspace(self._context)
        textures = ball_textures(self._context.gl, balls, variant.with_colors)
        starts = np.array([0, len(balls)]) if groups is None else groups.starts
        for region in _parts(camera, min(self._context.limits.texture_size, self._context.limits.viewport_size)):
            part = replace(camera, region=region).cropped()
            check_cancelled = partial(request.watch, region.y_min / camera.height)
            frame = Frame(self._context, workspace, (part.width, part.height), variant, len(balls), check_cancelled)
            frame.bind(textures, frame_uniforms(balls, distances, part, field))
            corners = None if groups is None else groups.corners(part, distances.depth_scale)
            counts = frame.draw(starts, corners)
            rows, columns = slice(region.y_min, region.y_max), slice(region.x_min, region.x_max)
            normal_depth = frame.read(0)
            surface.normal[rows, columns] = normal_depth[..., :3]
            surface.depth[rows, columns] = np.minimum(normal_depth[..., 3], DEPTH_BACKGROUND)
            if surface.color is not None:
                surface.color[rows, columns] = frame.read(1)[..., :3]
            for name, count in counts.items():
                surface.counts[name] = surface.counts.get(name, 0) + count


def create() -> DepthPeeling:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return _on(shared_context())


@lru_cache(maxsize=1)
def _on(context: GpuContext) -> DepthPeeling:
    """One that keeps its render targets, until the process gets another context."""
    return DepthPeeling(context)


def _empty(camera: Camera, with_color: bool) -> Surface:
    """The surface of nothing, to be filled."""
    shape = (camera.height, camera.width)
    color = np.zeros((*shape, 3), np.float32) if with_color else None
    return Surface(np.full(shape, DEPTH_BACKGROUND, np.float32), np.zeros((*shape, 3), np.float32), color)


def _parts(camera: Camera, max_side: int) -> Iterator[Region]:
    """Parts of the image that fit into textures and into memory, in rows from below."""
    columns = min(camera.width, max_side)
    rows = max(1, min(_PIXELS_A_PART // columns, max_side))
    for bottom in range(0, camera.height, rows):
        for left in range(0, camera.width, columns):
            yield Region(left, bottom, min(left + columns, camera.width), min(bottom + rows, camera.height))
