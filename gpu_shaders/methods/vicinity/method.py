"""Runs the shaders of Vicinity; see the package for what it does."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ....addon.fluid.balls import Balls
from ....addon.fluid.camera import Camera
from ....addon.fluid.errors import InputError
from ....addon.fluid.kernels import KERNELS, PolynomialKernel
from ....addon.render.method import Request, timed
from ....addon.render.neighbours import MOST_NEIGHBOURS, Neighbours, find_neighbours
from ...context import GpuContext, shared_context
from ...parted_method import PartedMethod
from ...scene_camera import box_depths, scene_camera_uniforms, scene_depth_scale
from ...stage_times import StageTimes
from ...step import Step, Texture
from ...surface_textures import SurfaceTextures
from .balls import BallTextures
from .params import BISECTIONS, EXACT, METHOD, SAMPLES
from .programs import Variant

_CORNERS = 6
"""Vertices of a ball's rectangle."""


class Vicinity(PartedMethod[Neighbours]):
    """The method on one OpenGL context."""

    pixels_a_part = 2**22

    def __init__(self, context: GpuContext) -> None:
        # Depth, normal, three attributes and the barrier.
        context.require(METHOD.gl_version, draw_buffers=6)
        super().__init__(context, METHOD)
        self._steps: dict[Variant, dict[str, Step]] = {}
        self._lists: tuple[Balls, Neighbours] | None = None
        self._balls: BallTextures | None = None
        self._targets: _Targets | None = None
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: self._steps_of(Variant(KERNELS["wyvill"])))

    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> Neighbours | None:
        """The neighbours of the balls; InputError where what is asked for does not go together, or lists are too long."""
        _check(request)
        return self._lists_of(request, milliseconds) if len(request.balls) else None

    def counts_of(self, scene: Neighbours) -> Mapping[str, int]:
        """See :meth:`PartedMethod.counts_of`."""
        return {"neighbours": len(scene.places), "lone_balls": int(np.count_nonzero(scene.counts == 0))}

    def forget(self) -> None:
        """See :meth:`PartedMethod.forget`."""
        self._balls, self._targets = None, None

    def _lists_of(self, request: Request, milliseconds: dict[str, float]) -> Neighbours:
        """The neighbours of the balls, which stay while the same balls are asked for; the time that new ones took."""
        if self._lists is None or self._lists[0] is not request.balls:
            self._lists, self._balls = None, None  # their memory may be needed
            most = min(self._context.limits.texture_buffer_size, MOST_NEIGHBOURS)
            with timed(milliseconds, "neighbours"):
                found = find_neighbours(request.balls, most=most, threads=request.threads, watch=request.watch)
            self._lists = request.balls, found
        return self._lists[1]

    def fill(self, request: Request, scene: Neighbours, camera: Camera, textures: SurfaceTextures) -> None:
        """See :meth:`PartedMethod.fill`."""
        times = StageTimes(self._context)
        with times.of("upload"):
            balls = self._uploaded(request, scene)
        with times.of("cast"):
            self._draw(request, balls, scene, camera, textures)
        textures.add_report(times.milliseconds, {})

    def _uploaded(self, request: Request, lists: Neighbours) -> BallTextures:
        attributes = frozenset(request.known_attributes)
        if self._balls is None:
            self._balls = BallTextures(self._context, request.balls, lists, request.field, attributes)
        if self._balls.field != request.field:
            self._balls.set_field(request.field)
        self._balls.add(attributes)
        return self._balls

    def _draw(
        self, request: Request, balls: BallTextures, lists: Neighbours, camera: Camera, textures: SurfaceTextures
    ) -> None:
        """Draw kernel spheres, find where rays start inside, and cast."""
        gl, field = self._context.gl, request.field
        box = request.balls.bounds
        uniforms = {
            **scene_camera_uniforms(box - lists.origin, lists.origin, camera),
            **balls.uniforms,
            **_setting_uniforms(request.settings),
            "isovalue": field.threshold,
            "depth_scale": scene_depth_scale(camera, box),
        }
        # Where all influence spheres begin behind the near clip plane no ray can start in one.
        may_start_inside = float(np.min(box_depths(box, camera))) <= camera.clip_start * (1 + 1e-6)
        with_starts = may_start_inside or bool(np.any(request.balls.weights < 0))
        variant = Variant(
            field.density_kernel,
            request.balls.weight is None,
            with_starts,
            bool(request.settings[EXACT.name]),
            request.known_attributes,
        )
        steps = self._steps_of(variant)
        for step in steps.values():
            step.set_uniforms(uniforms)
        targets = self._targets_of(textures.size)
        gl.disable(moderngl.BLEND | moderngl.CULL_FACE)
        vertices = _CORNERS * len(request.balls)
        targets.kernel.clear(depth=1.0)
        _draw(gl, steps["kernel"], targets.kernel, vertices, balls.textures, moderngl.DEPTH_TEST, "<")
        read: dict[str, Texture] = {**balls.textures, "kernel_depth_tx": targets.kernel_depth}
        if with_starts:
            targets.start.clear()
            gl.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
            gl.blend_func = moderngl.ONE, moderngl.ONE
            _draw(gl, steps["start"], targets.start, vertices, read, moderngl.BLEND)
            read["start_tx"] = targets.start_density
        found = list(textures.textures.values())
        begin = gl.framebuffer([*found, targets.barrier], targets.depth)
        _draw(gl, steps["begin"], begin, 3, read, moderngl.DEPTH_TEST, "1")
        cast = gl.framebuffer(found, targets.depth)
        _draw(gl, steps["cast"], cast, vertices, {**read, "barrier_tx": targets.barrier}, moderngl.DEPTH_TEST, "<=")

    def _targets_of(self, size: tuple[int, int]) -> _Targets:
        if self._targets is None or self._targets.size != size:
            self._targets = None  # its memory may be needed
            self._targets = _Targets(self._context, size)
        return self._targets

    def _steps_of(self, variant: Variant) -> dict[str, Step]:
        if variant not in self._steps:
            self._steps[variant] = {name: Step(self._context, program) for name, program in variant.programs().items()}
        return self._steps[variant]


def create() -> Vicinity:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(Vicinity)


class _Targets:
    """What is drawn into beside the surface, for one size of image."""

    def __init__(self, context: GpuContext, size: tuple[int, int]) -> None:
        gl = context.gl
        self.size = size
        self.kernel_depth = context.depth_texture(size)
        self.depth = context.depth_texture(size)
        self.start_density = gl.texture(size, 2, dtype="f4")
        self.barrier = gl.texture(size, 1, dtype="f4")
        for texture in (self.start_density, self.barrier):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.kernel = gl.framebuffer([], self.kernel_depth)
        self.start = gl.framebuffer([self.start_density])


def _setting_uniforms(settings: Mapping[str, bool | int | float]) -> dict[str, object]:
    return {setting.name: int(settings[setting.name]) for setting in (SAMPLES, BISECTIONS)}


def _check(request: Request) -> None:
    """InputError where what is asked for does not go together."""
    kernel = request.field.density_kernel
    if request.settings[EXACT.name] and not isinstance(kernel, PolynomialKernel):
        raise InputError(
            f"{METHOD.label} finds the exact surface of polynomial kernels only, and {kernel.label} is none; switch "
            f"'{EXACT.label}' off, or choose another kernel"
        )


def _draw(
    gl: moderngl.Context,
    step: Step,
    framebuffer: moderngl.Framebuffer,
    vertices: int,
    textures: Mapping[str, Texture],
    flags: int,
    depth_func: str = "<",
) -> None:
    gl.enable_only(flags)
    gl.depth_func = depth_func
    framebuffer.viewport = (0, 0, *framebuffer.size)
    step.draw(framebuffer, moderngl.TRIANGLES, vertices, textures)
