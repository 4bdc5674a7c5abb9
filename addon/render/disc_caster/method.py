"""Moves and draws surface particles in the native core; see the package for what it does."""

from __future__ import annotations

from .. import native
from ..method import Request, Surface, timed, unfilled_surface
from ..particle_follower import particles_at
from ..particle_settings import EXACT, simulation_options
from ..surface_particles import SurfaceParticles
from .params import METHOD


class DiscCaster:
    """See :mod:`disc_caster`."""

    @property
    def device(self) -> str:
        """See :func:`native.device`."""
        return native.device()

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`; the particles follow those of the image before in the request's sequence."""
        surface = unfilled_surface(request)
        with timed(surface.milliseconds, "particles"):
            shown = particles_at(request, METHOD.name, lambda: SurfaceParticles(**simulation_options(request.settings)))
        with timed(surface.milliseconds, "draw"):
            shown.particles.draw(
                request.balls,
                request.camera,
                surface,
                is_exact=bool(request.settings[EXACT.name]),
                threads=request.threads,
                watch=request.watch,
            )
        surface.counts, surface.notes = shown.counts, shown.notes
        return surface


def create() -> DiscCaster:
    """The method, ready to run; raises DeviceError where the native core is missing."""
    native.load()
    return DiscCaster()
