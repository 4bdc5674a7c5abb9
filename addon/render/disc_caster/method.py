"""Moves and draws surface particles in the native core; see the package for what it does."""

from __future__ import annotations

import platform

from .. import native
from ..method import Request, Surface, timed, unfilled_surface
from ..particle_follower import ParticleFollower
from ..particle_settings import EXACT, FOLLOWS, simulation_options
from ..surface_particles import SurfaceParticles


class DiscCaster:
    """See :mod:`disc_caster`."""

    def __init__(self) -> None:
        self._native = native.load()

    @property
    def device(self) -> str:
        """The processor's architecture, and which of its instructions are used."""
        with native.translated_errors():
            return f"CPU ({platform.machine()}), {self._native.simd_path()}"

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`; the particles follow those of the image before in the request's sequence."""
        surface = unfilled_surface(request)
        key = tuple(sorted(request.settings.items()))
        follower = request.instant.sequence.kept("disc_caster", key, lambda: _follower(request))
        seconds = request.instant.seconds if request.settings[FOLLOWS.name] else None
        with timed(surface.milliseconds, "particles"):
            follower.go_to(request.balls, request.field, seconds, threads=request.threads, watch=request.watch)
        with timed(surface.milliseconds, "draw"):
            follower.particles.draw(
                request.balls,
                request.camera,
                surface,
                is_exact=bool(request.settings[EXACT.name]),
                threads=request.threads,
                watch=request.watch,
            )
        surface.counts = {"particles": len(follower.particles)}
        return surface


def _follower(request: Request) -> ParticleFollower[SurfaceParticles]:
    return ParticleFollower(SurfaceParticles(**simulation_options(request.settings)))


def create() -> DiscCaster:
    """The method, ready to run; raises DeviceError where the native core is missing."""
    return DiscCaster()
