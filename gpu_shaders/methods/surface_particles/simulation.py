"""Surface particles that move on the graphics processor.

What happens in a frame is what :class:`surface_particles.SurfaceParticles` does, pass by pass and with the same numbers: the
balls of the frame before carry the particles, they settle on the new surface, the native core fills gaps, and steps of
repulsion and dispersion spread them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.balls import Balls
from ....addon.fluid.field import Field
from ....addon.fluid.kernels import PolynomialKernel
from ....addon.render.surface_particles import ParticleCloud, ParticleReport, SurfaceParticles, adapted_reach
from ...context import GpuContext
from ...step import Step
from .crowds import Crowd, Reaches
from .fluid import FluidArrays, FluidTextures
from .programs import MotionPrograms
from .state import Discs, FloatArray, ParticleState, Pressures

Watch = Callable[[float], object]
Doubles = npt.NDArray[np.float64]

PUSH = 0.1
"""How far pressure moves a particle in a step, in reaches; see native/core/src/surface_particles/mod.rs."""


def _unwatched(_: float) -> None:
    """Lets all work go on."""


@dataclass(frozen=True)
class SimulationOptions:
    """How the particles behave, see :class:`surface_particles.SurfaceParticles`."""

    count: int
    cell_share: float = 1 / 3
    steps: int = 4
    disperses: bool = True
    fills_gaps: bool = True
    seed: int = 0


class GpuSurfaceParticles:
    """Particles that follow a fluid from frame to frame, on one OpenGL context.

    Parameters
    ----------
    context
        Where they move.
    crowd
        What finds their neighbours; made on the context's thread.
    options
        How they behave.
    """

    def __init__(self, context: GpuContext, crowd: Crowd, options: SimulationOptions) -> None:
        self._context, self._crowd, self._options = context, crowd, options
        # Places particles and fills gaps, from the anchor as the shaders see them.
        self._native = SurfaceParticles(
            options.count,
            cell_share=options.cell_share,
            steps=0,
            disperses=False,
            fills_gaps=options.fills_gaps,
            seed=options.seed,
        )
        self._fluid: FluidTextures | None = None
        self._state: ParticleState | None = None
        self._discs: Discs | None = None
        self._steps: tuple[PolynomialKernel, dict[str, Step]] | None = None
        self._reach = 0.0
        self._step = 0

    @property
    def reach(self) -> float:
        """How far particles push one another, in influence radii."""
        return self._reach

    def __len__(self) -> int:
        return 0 if self._state is None else self._state.count

    def seed(self, balls: Balls, field: Field, *, threads: int = 0, watch: Watch = _unwatched) -> ParticleReport:
        """Begin anew, see :meth:`surface_particles.SurfaceParticles.seed`; DeviceError also where the driver has too little."""
        self._fluid = self._state = self._discs = None  # their memory may be needed
        anchor = _anchor(balls)
        near = _from_anchor(balls, anchor)
        placed = self._native.seed(near, field, threads=threads, watch=watch).placed
        self._reach, self._step = self._native.reach, 0
        arrays = FluidArrays.of(near, field, self._native.hash(), anchor)
        cloud = self._native.cloud
        dispersed = self._context.run(lambda: self._spread(arrays.upload(self._context), cloud))
        return ParticleReport(0, placed, dispersed)

    def follow(
        self, balls: Balls, field: Field, seconds: float, *, threads: int = 0, watch: Watch = _unwatched
    ) -> ParticleReport:
        """Follow the fluid, see :meth:`surface_particles.SurfaceParticles.follow`."""
        before, state = self._fluid, self._state
        if before is None or state is None:
            return self.seed(balls, field, threads=threads, watch=watch)
        anchor = _anchor(balls)
        near = _from_anchor(balls, anchor)
        self._native.stand_on(near, field, threads=threads, watch=watch)
        arrays = FluidArrays.of(near, field, self._native.hash(), anchor)
        fluid, places, normals = self._context.run(lambda: self._carry(state, before, arrays, seconds))
        is_there = places[:, 3] > 0
        kept = (np.ascontiguousarray(rows[is_there]) for rows in (places[:, :3], normals[:, :3], places[:, 3]))
        self._step += self._options.fills_gaps
        placed = self._native.refill(*kept, reach=self._reach, step=self._step, threads=threads, watch=watch)
        cloud = self._native.cloud
        dispersed = self._context.run(lambda: self._spread(fluid, cloud))
        return ParticleReport(int(np.count_nonzero(~is_there)), placed, dispersed)

    @property
    def fluid(self) -> FluidTextures:
        """What the particles are on; there are some."""
        assert self._fluid is not None
        return self._fluid

    @property
    def disc_textures(self) -> dict[str, moderngl.Texture]:
        """What disc.vert reads; there are particles."""
        assert self._state is not None
        assert self._discs is not None
        return {**self._state.textures, **self._discs.textures}

    def positions(self) -> FloatArray:
        """(M, 3) world space, of those that have not lost the surface."""
        if self._state is None or self._fluid is None:
            return np.zeros((0, 3), np.float32)
        places, _ = self._context.run(self._state.read)
        return (places[places[:, 3] > 0, :3] + self._fluid.anchor).astype(np.float32)

    def _carry(
        self, state: ParticleState, before: FluidTextures, arrays: FluidArrays, seconds: float
    ) -> tuple[FluidTextures, FloatArray, FloatArray]:
        """The new fluid, and where the particles are on it."""
        flowed, settled = ParticleState(self._context, state.count), ParticleState(self._context, state.count)
        motion = {"seconds": seconds, "anchor_shift": tuple((before.anchor - arrays.anchor).tolist())}
        self._draw("flow", before, state, flowed.places_alone, motion)
        fluid = arrays.upload(self._context)
        self._draw("settle", fluid, flowed, settled.framebuffer, {})
        return fluid, *settled.read()

    def _spread(self, fluid: FluidTextures, cloud: ParticleCloud) -> int:
        """Spread particles over a fluid; how many changed their places."""
        self._fluid, self._state, self._discs = fluid, None, None
        count = len(cloud.positions)
        if not count:
            return 0
        state, moved = ParticleState.of(self._context, cloud), ParticleState(self._context, count)
        pressures = Pressures(self._context, count)
        if self._options.fills_gaps and self._options.steps and self._options.count:
            self._press(fluid, state, pressures)
            company = float(np.mean(pressures.read_company(), dtype=np.float64))
            self._reach = adapted_reach(company, self._reach)
        for _ in range(self._options.steps):
            self._step += 1
            self._press(fluid, state, pressures)
            self._move(fluid, state, pressures, moved)
            state, moved = moved, state
        self._press(fluid, state, pressures)
        self._state, self._discs = state, Discs(self._context, count)
        self._draw("note", fluid, state, self._discs.framebuffer, {"reach": self._reach}, pressures.textures)
        return int(state.read()[1][:, 3].sum())

    def _press(self, fluid: FluidTextures, state: ParticleState, pressures: Pressures) -> None:
        self._crowd.press(state, Reaches(self._reach, fluid.radii), self._step, pressures)

    def _move(self, fluid: FluidTextures, state: ParticleState, pressures: Pressures, moved: ParticleState) -> None:
        """A step of repulsion and dispersion."""
        values = {
            "reach": self._reach,
            "push": PUSH,
            "seed": self._options.seed,
            "step_number": self._step,
            "disperses": self._options.disperses,
        }
        self._draw("spread", fluid, state, moved.framebuffer, values, pressures.textures)

    def _draw(
        self,
        name: str,
        fluid: FluidTextures,
        state: ParticleState,
        target: moderngl.Framebuffer,
        values: Mapping[str, object],
        textures: Mapping[str, moderngl.Texture] | None = None,
    ) -> None:
        """Draw a fragment for each particle."""
        step = self._steps_for(fluid.field.polynomial_kernel)[name]
        step.set_uniforms({**fluid.uniforms, **state.uniforms, **values})
        step.draw_plainly(target, {**fluid.textures, **state.textures, **(textures or {})})

    def _steps_for(self, kernel: PolynomialKernel) -> dict[str, Step]:
        if self._steps is None or self._steps[0] != kernel:
            programs = MotionPrograms(kernel).programs()
            self._steps = kernel, {name: Step(self._context, source) for name, source in programs.items()}
        return self._steps[1]


def _anchor(balls: Balls) -> Doubles:
    """(3,): amidst the balls, near the smallest: there single precision has to be finest."""
    if not len(balls):
        return np.zeros(3)
    weights = (float(np.min(balls.radii)) / balls.radii.astype(np.float64)) ** 4
    return np.asarray(weights @ balls.positions / np.sum(weights), np.float64)


def _from_anchor(balls: Balls, anchor: Doubles) -> Balls:
    """The balls with positions that count from the anchor."""
    positions = (balls.positions.astype(np.float64) - anchor).astype(np.float32)
    return Balls(positions, balls.radii, balls.weights, velocities=balls.velocities)
