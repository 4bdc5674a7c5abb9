"""Points that live on the surface of a fluid and move with it (van Kooten, van den Bergen and Telea 2007)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.errors import InputError
from ..fluid.field import Field
from ..fluid.passes import DEPTH_BACKGROUND
from . import native
from .method import Surface

MOST_SECONDS = 1e6
"""Longer steps in time are a mistake."""


@dataclass(frozen=True)
class ParticleCloud:
    """Surface particles of one frame, in no order.

    Attributes
    ----------
    positions, normals
        (M, 3) float32, world space: on the surface, and unit, out of the fluid.
    velocities
        (M, 3) float32, units a second: of the surface there, as far as balls have velocities.
    scales
        (M,) float32, Blender units: how large the balls are there, the mean of their influence radii.
    spacings
        (M,) float32, Blender units: the distance to its neighbours if they were spread evenly as densely as they are here.
    ids
        (M,) uint32: stays with a particle until that is placed anew.
    """

    positions: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    velocities: npt.NDArray[np.float32]
    scales: npt.NDArray[np.float32]
    spacings: npt.NDArray[np.float32]
    ids: npt.NDArray[np.uint32]


@dataclass(frozen=True)
class HashLevel:
    """The spatial hash of the balls whose radii are in one octave (sections 7.2.4 and 7.2.5).

    Attributes
    ----------
    side
        Of a cell, Blender units.
    starts
        (B + 1,) uint32: where the entries of each of B buckets begin, a power of two, and where the last ends.
    entries
        (E, 2) uint32: a ball, and the tag of a cell that it reaches.
    """

    side: float
    starts: npt.NDArray[np.uint32]
    entries: npt.NDArray[np.uint32]


@dataclass(frozen=True)
class ParticleReport:
    """How many particles lost the surface, were placed anew, and left a dense place for a thin one."""

    lost: int
    placed: int
    dispersed: int


def adapted_reach(company: float, reach: float) -> float:
    """The reach of a frame, of the one before and of how many others are within that on average."""
    return float(native.load().SurfaceParticles.adapted_reach(company, reach))


class SurfaceParticles:
    """Particles that follow a fluid from frame to frame.

    Parameters
    ----------
    count
        How many there are at most, up to 16,777,216; 0 for as many as the surface asks for, about fifty for a lone ball.
    cell_share
        The side of the spatial hash's cells as a share of a ball's diameter, 0.05 to 1 (the paper: a third to a fifth).
    steps
        Steps of repulsion in each frame, 0 to 1000.
    disperses
        Whether particles also leave dense places for thin ones (section 7.4).
    fills_gaps
        Whether places without particles get some at once, those of new droplets too.
    seed
        Another number, another spread.

    Raises
    ------
    InputError
        A parameter is out of its range.
    DeviceError
        The native core is missing.
    """

    def __init__(
        self,
        count: int = 0,
        *,
        cell_share: float = 1 / 3,
        steps: int = 4,
        disperses: bool = True,
        fills_gaps: bool = True,
        seed: int = 0,
    ) -> None:
        options = {"cell_share": cell_share, "steps": steps, "disperses": disperses, "fills_gaps": fills_gaps, "seed": seed}
        with native.translated_errors():
            self._particles = native.load().SurfaceParticles(count=count, **options)

    def seed(
        self,
        balls: Balls,
        field: Field,
        points: npt.NDArray[np.float32] | None = None,
        *,
        threads: int = 0,
        watch: Callable[[float], object] = native.let_interrupt,
    ) -> ParticleReport:
        """Begin anew on these balls: all over their surface, or at `points` (K, 3), each moved onto the surface near it.

        Raises
        ------
        InputError, DeviceError
            The points or the kernel are unusable; there is too little memory.
        """
        if points is not None:
            points = np.ascontiguousarray(points, np.float32)
        return self._go(balls, field, threads, watch, points=points)

    def follow(
        self,
        balls: Balls,
        field: Field,
        seconds: float,
        *,
        threads: int = 0,
        watch: Callable[[float], object] = native.let_interrupt,
    ) -> ParticleReport:
        """Follow the fluid to these balls of `seconds` later, or earlier where that is negative.

        They go by the velocities of the balls before (equations 2 and 3).
        After a cut or a jump in time call :meth:`seed` instead. The errors are those of :meth:`seed`.
        """
        if not abs(seconds) <= MOST_SECONDS:
            raise InputError(f"The time between two frames must be at most {MOST_SECONDS:g} seconds, not {seconds}")
        return self._go(balls, field, threads, watch, seconds=float(seconds))

    def _go(self, balls: Balls, field: Field, threads: int, watch: Callable[[float], object], **how: object) -> ParticleReport:
        given = native.fluid_arguments(balls, field)
        with native.translated_errors():
            return ParticleReport(*self._particles.go(*given, velocities=balls.velocities, threads=threads, watch=watch, **how))

    def stand_on(
        self, balls: Balls, field: Field, *, threads: int = 0, watch: Callable[[float], object] = native.let_interrupt
    ) -> None:
        """Make these balls those that the particles are to be on, which are moved elsewhere; the errors are those of `seed`."""
        given = native.fluid_arguments(balls, field)
        with native.translated_errors():
            self._particles.stand_on(*given, velocities=balls.velocities, threads=threads, watch=watch)

    def hash(self) -> list[HashLevel]:
        """Which of the present balls reach a point."""
        return [HashLevel(*level) for level in self._particles.hash()]

    def refill(
        self,
        positions: npt.NDArray[np.float32],
        normals: npt.NDArray[np.float32],
        scales: npt.NDArray[np.float32],
        *,
        reach: float,
        step: int,
        threads: int = 0,
        watch: Callable[[float], object] = native.let_interrupt,
    ) -> int:
        """Take particles at (M, 3), which are on the present balls, in place of its own, and fill the gaps between them.

        Parameters
        ----------
        reach
            How far particles push one another, in influence radii.
        step
            A number that differs from frame to frame, which the places depend on.

        Returns how many were placed; in the cloud they come last. The errors are those of `seed`.
        """
        with native.translated_errors():
            return int(self._particles.refill(positions, normals, scales, reach=reach, step=step, threads=threads, watch=watch))

    def draw(
        self,
        balls: Balls,
        camera: Camera,
        surface: Surface,
        *,
        is_exact: bool,
        threads: int = 0,
        watch: Callable[[float], object] = native.let_interrupt,
    ) -> None:
        """Fill a surface of a camera's size with what it sees of the particles as discs (section 7.6).

        Parameters
        ----------
        balls
            Those that the particles are on.
        camera
            Without a region.
        is_exact
            Whether what the discs show is moved onto the surface in each pixel.

        Raises
        ------
        InputError, DeviceError
            Sizes differ, or nothing was seeded yet; there is too little memory.
        """
        pairs = ((balls.colors, surface.color), (balls.velocities, surface.velocity))
        with native.translated_errors():
            native.load().draw_discs(
                self._particles,
                surface.depth,
                surface.normal,
                background=DEPTH_BACKGROUND,
                is_exact=is_exact,
                **native.view_arguments(camera),
                ball=surface.ball,
                attributes=[(source, target) for source, target in pairs if source is not None and target is not None],
                threads=threads,
                watch=watch,
            )

    @property
    def reach(self) -> float:
        """How far particles push one another, in influence radii."""
        return float(self._particles.reach)

    def __len__(self) -> int:
        """How many there are."""
        return int(self._particles.count())

    @property
    def cloud(self) -> ParticleCloud:
        """The particles."""
        return ParticleCloud(*self._particles.arrays())
