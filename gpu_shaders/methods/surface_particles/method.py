"""Moves and draws surface particles; see the package for what it does."""

from __future__ import annotations

from collections.abc import Mapping

from ....addon.fluid.camera import Camera
from ....addon.render.method import Request, timed
from ....addon.render.particle_follower import ParticleFollower
from ....addon.render.particle_settings import EXACT, FOLLOWS, simulation_options
from ...context import GpuContext, shared_context
from ...parted_method import PartedMethod
from ...stage_times import StageTimes
from ...surface_textures import SurfaceTextures
from .crowds import best_crowd
from .drawing import Drawing
from .params import METHOD
from .simulation import GpuSurfaceParticles, SimulationOptions


class SurfaceParticlesMethod(PartedMethod[GpuSurfaceParticles]):
    """The method on one OpenGL context."""

    def __init__(self, context: GpuContext) -> None:
        # Depth, normal, the attributes, and how far rays have come.
        context.require(METHOD.gl_version, 3 + len(METHOD.attributes))
        super().__init__(context, METHOD)
        self._crowd = context.run(lambda: best_crowd(context))

    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> GpuSurfaceParticles | None:
        """The particles of the request's time; they follow those of the image before in its sequence."""
        if not len(request.balls):
            return None
        key = self._context, tuple(sorted(request.settings.items()))
        follower = request.instant.sequence.kept("surface_particles", key, lambda: self._follower(request))
        seconds = request.instant.seconds if request.settings[FOLLOWS.name] else None
        with timed(milliseconds, "particles"):
            follower.go_to(request.balls, request.field, seconds, threads=request.threads, watch=request.watch)
        return follower.particles if len(follower.particles) else None

    def _follower(self, request: Request) -> ParticleFollower[GpuSurfaceParticles]:
        options = SimulationOptions(**simulation_options(request.settings))
        return ParticleFollower(GpuSurfaceParticles(self._context, self._crowd, options))

    def counts_of(self, scene: GpuSurfaceParticles) -> Mapping[str, int]:
        """See :meth:`PartedMethod.counts_of`."""
        return {"particles": len(scene)}

    def fill(self, request: Request, scene: GpuSurfaceParticles, camera: Camera, textures: SurfaceTextures) -> None:
        """See :meth:`PartedMethod.fill`."""
        times = StageTimes(self._context)
        with times.of("draw"):
            Drawing(self._context, request, scene, bool(request.settings[EXACT.name])).draw(camera, textures)
        textures.add_report(times.milliseconds, {})


def create() -> SurfaceParticlesMethod:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(SurfaceParticlesMethod)
