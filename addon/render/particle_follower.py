"""Surface particles from one frame to the next: when they follow the fluid, and when they begin anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from ..fluid.balls import Balls
from ..fluid.field import Field
from . import native
from .surface_particles import ParticleReport

LONGEST_STEP = 0.25
"""Seconds between frames that follow one another; what is farther apart is a jump."""

_CUT = 0.5
"""Where a larger share of the particles lose the surface, it is another fluid."""


class FollowingParticles(Protocol):
    """Surface particles, on whatever processor; see :class:`surface_particles.SurfaceParticles`."""

    def __len__(self) -> int: ...

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

        They follow the fluid where the frame before is up to `LONGEST_STEP` seconds away, for samples of motion blur go to and fro,
        and begin anew after jumps and cuts. `seconds` is by the clock of the scene; None begins anew. The errors are those of
        :meth:`surface_particles.SurfaceParticles.seed`.
        """
        shown, before = self._shown, self._seconds
        if shown is not None and shown[0] is balls and shown[1] == field:
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
