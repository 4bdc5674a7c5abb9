"""Runs the shaders of Walking Depth Plane; see the package for what it does."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, fields
from functools import partial

import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera
from ....addon.fluid.view_balls import ViewBalls
from ....addon.render.method import Request, Surface
from ...context import GpuContext, shared_context
from ...sampling.method import SamplingMethod, SeenBalls, sampling_uniforms
from ...sampling.passes import SamplingPasses
from ...sampling.programs import SamplingVariant
from ...surface_textures import SurfaceTextures
from .budget import Budget, Clock, Experience
from .frame import Ending, Frame, WalkTargets
from .params import METHOD
from .programs import programs_of

NARROWING_PASSES = 64
"""What the bound on passes leaves for rays that all but touch the surface, and for narrowing brackets."""


@dataclass(frozen=True)
class TimedRequest(Request):
    """A request, and the time that it may take."""

    budget: Budget | None = None


class WalkingDepthPlane(SamplingMethod):
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    clock
        Tells the time, seconds.
    """

    def __init__(self, context: GpuContext, clock: Clock = time.perf_counter) -> None:
        super().__init__(context, METHOD)
        self._clock = clock
        self._experience = Experience()
        self._targets: WalkTargets | None = None

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        timed = self._timed(request)
        surface = super().find_surface(timed)
        self._note_end(timed)
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        timed = self._timed(request)
        textures = super().find_surface_on_device(timed)
        self._note_end(timed)
        return textures

    def draw(
        self, request: Request, seen: SeenBalls, camera: Camera, output: SurfaceTextures, corner: tuple[int, int]
    ) -> dict[str, int]:
        """See :meth:`SamplingMethod.draw`."""
        assert isinstance(request, TimedRequest)
        assert request.budget is not None
        settings = request.settings
        variant = SamplingVariant(request.field.density_kernel, seen.attributes)
        targets = seen.workspace.targets((camera.width, camera.height), seen.summed)
        if self._targets is None or self._targets.shared is not targets:
            self._targets = WalkTargets(self._context, targets)
        passes = SamplingPasses(self._context, targets, programs_of(variant), len(seen.balls))
        smallest = float(np.min(ball_paces(seen.balls)))
        uniforms = {
            "step_share": float(settings["step"]),
            "tolerance": float(settings["tolerance"]),
            "smallest_ball": smallest,
        }
        passes.bind(seen.textures, {**sampling_uniforms(request, seen, camera), **uniforms})
        frame = Frame(passes, self._targets, seen.workspace.queries, partial(request.watch, 0.0))
        bound = pass_bound(seen.balls, camera, float(settings["step"]) * smallest)
        ending = Ending(min(int(settings["most_passes"]), bound), float(settings["finished"]))
        counts = frame.walk(ending, request.budget)
        passes.refine(int(settings["refinements"]))
        passes.finish(output, corner)
        if request.budget.is_limited:
            self._context.gl.finish()
        return counts

    def _timed(self, request: Request) -> TimedRequest:
        seconds = float(request.settings["budget"]) / 1e3 if request.settings["use_budget"] else None
        budget = Budget(self._clock, seconds, request.camera.width * request.camera.height, self._experience)
        return TimedRequest(**{field.name: getattr(request, field.name) for field in fields(Request)}, budget=budget)

    @staticmethod
    def _note_end(request: TimedRequest) -> None:
        assert request.budget is not None
        if request.budget.is_limited:
            request.budget.note_end()


def ball_paces(balls: ViewBalls) -> npt.NDArray[np.float64]:
    """(M,): what ball_pace in ahead.frag says of each ball for rays through its middle, Blender units."""
    return np.clip(balls.kernel_radii, 0.125 * balls.radii, 0.5 * balls.radii)


def pass_bound(balls: ViewBalls, camera: Camera, longest_step: float) -> int:
    """Passes that are enough unless rays all but touch the surface for long: twice as many as the longest step needs to cross
    the depth of what is seen (Mueller et al. 2007, section 3.2.4).
    """
    depths = -balls.centers[:, 2]
    near = max(float(np.min(depths - balls.radii)), camera.clip_start)
    far = min(float(np.max(depths + balls.radii)), camera.clip_end)
    return NARROWING_PASSES + math.ceil(min(2 * max(far - near, 0.0) / longest_step, 1e9))


def create() -> WalkingDepthPlane:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(WalkingDepthPlane)
