"""Surface particles from one frame to the next: when they follow the fluid, and when they begin anew."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ..fluid.balls import Balls
from ..fluid.field import Field
from . import native
from .method import Request
from .particle_settings import FOLLOWS
from .surface_particles import ParticleReport

LONGEST_STEP = 0.25
"""Seconds between frames that follow one another; what is farther apart is a jump."""

_CUT = 0.5
"""Where a larger share of the particles lose the surface, it is another fluid."""


TOO_SPARSE = 2.0
"""Influence radii: where particles reach farther, a lone ball has seven or fewer."""


class FollowingParticles(Protocol):
    """Surface particles, on whatever processor; see :class:`surface_particles.SurfaceParticles`."""

    def __len__(self) -> int: ...

    @property
    def reach(self) -> float: ...

    def seed(self, balls: Balls, field: Field, *, threads: int, watch: Callable[[float], object]) -> ParticleReport: ...

    def follow(
        self, balls: Balls, field: Field, seconds: float, *, threads: int, watch: Callable[[float], object]
    ) -> ParticleReport: ...


Particles = TypeVar("Particles", bound=FollowingParticles)


class ParticleFollower(Generic[Particles]):
    """Surface particles of a sequence of frames.

    Parameters
    ----------
    particles
        What is brought from frame to frame.

    Attributes
    ----------
    particles
        Those of the frame that was gone to last.
    """

    def __init__(self, particles: Particles) -> None:
        self.particles = particles
        self._shown: tuple[Balls, Field] | None = None
        self._seconds: float | None = None

    def go_to(
        self,
        balls: Balls,
        field: Field,
        seconds: float | None,
        *,
        threads: int = 0,
        watch: Callable[[float], object] = native.let_interrupt,
    ) -> ParticleReport:
        """Bring the particles to a frame; nothing happens for the balls that they are on already.

        They follow the fluid where the frame before is up to `LONGEST_STEP` seconds away, to and fro as samples of motion blur
        are, and begin anew after jumps and cuts. `seconds` is by the clock of the scene; None begins anew. The errors are
        those of :meth:`surface_particles.SurfaceParticles.seed`.
        """
        shown, before = self._shown, self._seconds
        if shown is not None and shown[0] is balls and shown[1] == field:
            # Fluid that rests is followed when it goes on.
            self._seconds = seconds
            return ParticleReport(0, 0, 0)
        # What is interrupted leaves nothing to follow.
        self._shown = self._seconds = None
        report = self._moved(balls, field, _step(before, seconds), threads, watch)
        self._shown, self._seconds = (balls, field), seconds
        return report

    def _moved(
        self, balls: Balls, field: Field, step: float | None, threads: int, watch: Callable[[float], object]
    ) -> ParticleReport:
        count = len(self.particles)
        if step is not None and count:
            report = self.particles.follow(balls, field, step, threads=threads, watch=watch)
            if report.lost <= _CUT * count:
                return report
        return self.particles.seed(balls, field, threads=threads, watch=watch)


def _step(before: float | None, seconds: float | None) -> float | None:
    """The time between two frames of which the second follows the first; None where it does not."""
    if before is None or seconds is None or abs(seconds - before) > LONGEST_STEP:
        return None
    return seconds - before


@dataclass(frozen=True)
class ShownParticles(Generic[Particles]):
    """Surface particles at the time of an image, and how they came there.

    Attributes
    ----------
    particles, report
        Those, and what happened to them since the image before.
    """

    particles: Particles
    report: ParticleReport

    @property
    def counts(self) -> dict[str, int]:
        """See :attr:`method.Surface.counts`."""
        report = self.report
        return {"particles": len(self.particles), "particles_placed": report.placed, "particles_lost": report.lost}

    @property
    def notes(self) -> tuple[str, ...]:
        """See :attr:`method.Surface.notes`."""
        if not len(self.particles) or self.particles.reach <= TOO_SPARSE:
            return ()
        count = len(self.particles)
        return (f"{count} surface particles are too few for this fluid, parts of it are missing: raise their number, or set 0",)


def particles_at(
    request: Request, method: str, make: Callable[[], Particles], home: Hashable = None
) -> ShownParticles[Particles]:
    """The surface particles of a request's time, which follow those of the image before in its sequence.

    `method` is its name; `make` makes particles for the request's settings, at `home`, which is the OpenGL context where
    there is one. The errors are those of :meth:`ParticleFollower.go_to`.
    """
    key = home, *sorted(request.settings.items())
    follower = request.instant.sequence.kept(method, key, lambda: ParticleFollower(make()))
    seconds = request.instant.seconds if request.settings[FOLLOWS.name] else None
    report = follower.go_to(request.balls, request.field, seconds, threads=request.threads, watch=request.watch)
    return ShownParticles(follower.particles, report)
