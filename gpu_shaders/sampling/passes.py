"""Passes over the pixels, and over the balls, of methods that sample."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import moderngl

from ..context import GpuContext
from ..occlusion import OcclusionQueries, OcclusionQuery
from ..programs import ProgramSource
from ..step import Step, Texture
from ..surface_textures import SurfaceTextures
from .targets import SamplingTargets


class SamplingPasses:
    """Draws one image; on the context's thread.

    Parameters
    ----------
    context, targets
        Where to draw.
    programs
        Those of a :class:`programs.SamplingVariant`, and the method's own.
    ball_count
        How many balls there are.

    Attributes
    ----------
    samples, sums
        For each pixel the distances that are asked for, and the densities there.
    now, bracket
        What is known of the surface, the one of that number; a method draws into the other one and calls :meth:`turn`.
    """

    def __init__(
        self, context: GpuContext, targets: SamplingTargets, programs: Iterable[ProgramSource], ball_count: int
    ) -> None:
        self._gl = context.gl
        self._ball_count = ball_count
        self._now = 0
        self.targets = targets
        self.samples, self.sums = targets.samples, targets.sums[0]
        self.steps = {source.name: Step(context, source) for source in programs}

    def bind(self, textures: Mapping[str, moderngl.Texture], uniforms: Mapping[str, object]) -> None:
        """Give every step the balls and the camera."""
        shared = {**textures, **self.targets.cells.textures, "samples_tx": self.samples, "density_sum_tx": self.sums}
        shared |= {"side_tx": self.targets.side, "barrier_tx": self.targets.barrier}
        for step in self.steps.values():
            step.set_uniforms(uniforms)
            step.textures.update(shared)

    @property
    def now(self) -> int:
        """Which of each two targets is read."""
        return self._now

    @property
    def bracket(self) -> moderngl.Texture:
        """The brackets of all pixels."""
        return self.targets.brackets[self._now]

    def turn(self) -> None:
        """What was written is read from now on."""
        self._now = 1 - self._now

    def start(self, may_start_inside: bool, threshold: float) -> None:
        """Find out on which side of the surface the rays start; outside where they may not start inside.

        The cells of the image then ask for the starts of the rays.
        """
        self.over_screen("begin", self.targets.ask)
        if may_start_inside:
            self.sum_density()
            self.over_screen("start", self.targets.start)
        else:
            self.measure()
            self.targets.start.clear(1.0, -threshold)

    def find_barriers(self, may_carve: bool) -> None:
        """Find the nearest kernel spheres; none where balls of negative weight may carve them."""
        self.targets.bar.clear(depth=1.0)
        if not may_carve:
            self.over_balls("barrier", self.targets.bar, moderngl.DEPTH_TEST)

    def sum_density(self) -> None:
        """Sum the densities at the samples."""
        self.measure()
        self.targets.density.clear()
        self.blend(moderngl.FUNC_ADD)
        self.over_balls("density", self.targets.density, moderngl.BLEND | moderngl.DEPTH_TEST)

    def count(self, query: OcclusionQuery, name: str = "count", **textures: Texture) -> None:
        """Ask how many pixels a step does not discard: "count" those that ask for samples."""
        with query.asked():
            self.over_screen(name, self.targets.counting, **textures)

    def refine(self, times: int) -> None:
        """Narrow the brackets so often."""
        for _ in range(times):
            self.over_screen("guess", self.targets.ask, bracket_tx=self.bracket)
            self.sum_density()
            self.over_screen("narrow", self.targets.narrow[1 - self._now], bracket_tx=self.bracket)
            self.turn()

    def finish(self, output: SurfaceTextures, corner: tuple[int, int], uses_secant: bool = True) -> None:
        """Write the surface that the brackets tell to a corner of `output`, on their secants or where they end."""
        targets = self.targets
        self.steps["found"].set_uniforms({"uses_secant": uses_secant})
        self.over_screen("found", targets.ask, bracket_tx=self.bracket)
        self.measure()
        targets.gather.clear()
        self.blend(moderngl.FUNC_ADD)
        self.over_balls("gather", targets.gather, moderngl.BLEND | moderngl.DEPTH_TEST)
        if "dominant" in self.steps:
            # The bits of the float 0 are those of the number 0.
            targets.dominance.clear(depth=0.0)
            self.over_balls("dominant", targets.dominance, moderngl.DEPTH_TEST, depth_func=">")
        self._write(output, corner)

    def _write(self, output: SurfaceTextures, corner: tuple[int, int]) -> None:
        output.framebuffer.viewport = (*corner, *self.targets.size)
        self.steps["finish"].set_uniforms({"part_corner": tuple(map(float, corner))})
        summed = [name for name in output.passes if name in ("color", "velocity")]
        names = ["gradient_sum_tx", *(f"{name}_sum_tx" for name in summed)]
        sums = dict(zip(names, self.targets.sums, strict=False))
        self.over_screen("finish", output.framebuffer, **sums, dominant_tx=self.targets.dominant)

    def measure(self, name: str = "cells_from_samples", **textures: Texture) -> None:
        """The range of distances that each cell of the image asks for (Mishima et al. 2008, section 4.3).

        It is that of the samples, or what the step of this name tells of the finest cells.
        """
        cells = self.targets.cells
        self.over_screen(name, cells.framebuffers[0], **textures)
        for level in range(1, len(cells.levels)):
            self.steps["cells_from_cells"].set_uniforms({"smaller_count": cells.factors[level]})
            self.over_screen("cells_from_cells", cells.framebuffers[level], smaller_tx=cells.levels[level - 1])

    def blend(self, color: int, alpha: int | None = None) -> None:
        """How fragments are summed from now on."""
        self._gl.blend_equation = color, color if alpha is None else alpha
        self._gl.blend_func = moderngl.ONE, moderngl.ONE

    def over_screen(self, name: str, framebuffer: moderngl.Framebuffer, **textures: Texture) -> None:
        """Draw every pixel once; a depth buffer is written, never asked."""
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "1"
        self.steps[name].draw(framebuffer, moderngl.TRIANGLES, 3, textures)

    def over_balls(
        self, name: str, framebuffer: moderngl.Framebuffer, flags: int, depth_func: str = "<", **textures: Texture
    ) -> None:
        """Draw the rectangle of every ball that matters."""
        self._gl.enable_only(flags)
        self._gl.depth_func = depth_func
        self.steps[name].draw(framebuffer, moderngl.TRIANGLES, 6 * self._ball_count, textures)


class SamplingWorkspace:
    """What is kept from frame to frame on a context; use it within :meth:`GpuContext.run`.

    Attributes
    ----------
    queries
        Occlusion queries.
    """

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._targets: SamplingTargets | None = None
        self.queries = OcclusionQueries(context)

    def targets(self, size: tuple[int, int], summed: int) -> SamplingTargets:
        """The images of this size, new ones where the last were of another; `summed`: attributes that are summed."""
        if self._targets is None or (self._targets.size, self._targets.summed) != (size, summed):
            self._targets = None  # its memory may be needed
            self._targets = SamplingTargets(self._context, size, summed)
        return self._targets
