"""Runs the shaders of Equal Interval; see the package for what it does."""

from __future__ import annotations

from functools import partial

import numpy as np

from ....addon.fluid.camera import Camera
from ....addon.fluid.view_balls import ViewBalls
from ....addon.render.method import Request
from ...context import GpuContext, shared_context
from ...sampling.method import SamplingMethod, SeenBalls, sampling_uniforms
from ...sampling.passes import SamplingPasses
from ...sampling.programs import SamplingVariant
from ...surface_textures import SurfaceTextures
from .frame import Frame, MarchTargets
from .params import METHOD
from .programs import programs_of


class EqualInterval(SamplingMethod):
    """The method on one OpenGL context.

    Parameters
    ----------
    context
        Where to run.
    ball_culling
        Whether balls are left out that reach no sample of the pixels around them; the image stays the same.
    """

    def __init__(self, context: GpuContext, ball_culling: bool = True) -> None:
        super().__init__(context, METHOD)
        self._ball_culling = ball_culling
        self._targets: MarchTargets | None = None

    def draw(
        self, request: Request, seen: SeenBalls, camera: Camera, output: SurfaceTextures, corner: tuple[int, int]
    ) -> dict[str, int]:
        """See :meth:`SamplingMethod.draw`."""
        settings = request.settings
        variant = SamplingVariant(request.field.density_kernel, seen.attributes, self._ball_culling)
        targets = seen.workspace.targets((camera.width, camera.height), seen.summed)
        if self._targets is None or self._targets.shared is not targets:
            self._targets = MarchTargets(self._context, targets)
        passes = SamplingPasses(self._context, targets, programs_of(variant), len(seen.balls))
        share = float(settings["interval"])
        uniforms = {
            **sampling_uniforms(request, seen, camera),
            "interval": share,
            "only_interval": _only_interval(seen.balls, share),
            "greatest_weight": float(np.max(np.abs(seen.balls.weights), initial=1e-30)),
            "is_adaptive": bool(settings["adaptive"]),
        }
        passes.bind(seen.textures, uniforms)
        passes.find_barriers(may_carve=bool(np.any(seen.balls.weights < 0)))
        passes.start(seen.distances.with_starts, request.field.threshold)
        watch = partial(request.watch, 0.0)
        counts = Frame(passes, self._targets, seen.workspace.queries, settings, watch).march()
        refinements = int(settings["refinements"])
        passes.refine(max(refinements - 1, 0))
        passes.finish(output, corner, uses_secant=refinements > 0)
        return counts


def _only_interval(balls: ViewBalls, share: float) -> float:
    """The interval of all balls, see next.frag; 0 where they differ."""
    alone = np.where(balls.kernel_radii > 0, np.maximum(balls.kernel_radii / 2, balls.radii / 64), balls.radii)
    intervals = np.minimum(share * balls.radii, alone)
    return float(intervals[0]) if np.ptp(intervals) <= 1e-6 * intervals[0] else 0.0


def create() -> EqualInterval:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(EqualInterval)
