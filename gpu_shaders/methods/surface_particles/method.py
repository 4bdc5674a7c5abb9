"""Moves and draws surface particles; see the package for what it does."""

from __future__ import annotations

from collections.abc import Mapping

from ....addon.fluid.camera import Camera
from ....addon.fluid.kernels import KERNELS
from ....addon.render.method import Request, timed
from ....addon.render.particle_follower import ShownParticles, particles_at
from ....addon.render.particle_settings import EXACT, simulation_options
from ...context import GpuContext, shared_context
from ...parted_method import PartedMethod
from ...stage_times import StageTimes
from ...step import Step
from ...surface_textures import SurfaceTextures
from .crowds import best_crowd
from .drawing import DiscPainter
from .params import METHOD
from .programs import programs_of
from .simulation import GpuSurfaceParticles, SimulationOptions


class SurfaceParticlesMethod(PartedMethod[ShownParticles[GpuSurfaceParticles]]):
    """The method on one OpenGL context."""

    def __init__(self, context: GpuContext) -> None:
        # Depth, normal, the attributes, and how far rays have come.
        context.require(METHOD.gl_version, 3 + len(METHOD.attributes))
        super().__init__(context, METHOD)
        self._crowd, self._painter = context.run(lambda: (best_crowd(context), DiscPainter(context)))
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: [Step(context, source) for source in programs_of(KERNELS["wyvill"])])

    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> ShownParticles[GpuSurfaceParticles] | None:
        """The particles of the request's time."""
        with timed(milliseconds, "particles"):
            return particles_at(request, METHOD.name, lambda: self._particles(request), self._context)

    def _particles(self, request: Request) -> GpuSurfaceParticles:
        return GpuSurfaceParticles(self._context, self._crowd, SimulationOptions(**simulation_options(request.settings)))

    def counts_of(self, scene: ShownParticles[GpuSurfaceParticles]) -> Mapping[str, int]:
        """See :meth:`PartedMethod.counts_of`."""
        return scene.counts

    def notes_of(self, scene: ShownParticles[GpuSurfaceParticles]) -> tuple[str, ...]:
        """See :meth:`PartedMethod.notes_of`."""
        return scene.notes

    def forget(self) -> None:
        """See :meth:`PartedMethod.forget`."""
        self._painter.forget()

    def fill(
        self, request: Request, scene: ShownParticles[GpuSurfaceParticles], camera: Camera, textures: SurfaceTextures
    ) -> None:
        """See :meth:`PartedMethod.fill`."""
        if not len(scene.particles):
            textures.clear()
            return
        times = StageTimes(self._context)
        with times.of("draw"):
            self._painter.draw(request, scene.particles, bool(request.settings[EXACT.name]), camera, textures)
        textures.add_report(times.milliseconds, {})


def create() -> SurfaceParticlesMethod:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(SurfaceParticlesMethod)
