"""One image on its way through the shaders of Depth Peeling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ...buffer_texture import BufferTexture
from ...capture import Range
from ...context import GpuContext
from ...occlusion import OcclusionQuery
from ...step import Step, Texture
from ...surface_textures import SurfaceTextures
from .programs import LIST_TARGETS, Phase, Variant
from .targets import Workspace

FIRST_BATCH, LARGEST_BATCH = 2, 4
"""Passes between two looks at what is left: most pixels are done after a few, the others take long."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of a ball and a cell, in the order of the balls."""

    texture: BufferTexture
    count: int


class Frame:
    """Draws one image.

    Parameters
    ----------
    context, workspace
        Where to draw.
    size
        Width and height, pixels.
    variant
        What the programs depend on.
    ball_count
        How many balls there are.
    check_cancelled
        Called between batches; may raise.
    """

    def __init__(
        self,
        context: GpuContext,
        workspace: Workspace,
        size: tuple[int, int],
        variant: Variant,
        ball_count: int,
        check_cancelled: Callable[[], None],
    ) -> None:
        self._gl = context.gl
        self._workspace = workspace
        self._targets = workspace.targets(size, variant.options.diagnostics)
        self._variant = variant
        self._ball_count = ball_count
        self._check_cancelled = check_cancelled
        # Which of each pair of targets holds the present state, and the depth buffer for the next peel.
        self._now = 0
        self._steps = {name: Step(context, source) for name, source in variant.programs().items()}
        self._cells = self._targets.cells

    def bind(self, textures: dict[str, moderngl.Texture], uniforms: dict[str, object]) -> None:
        """Give every step the balls and the camera."""
        for step in self._steps.values():
            step.set_uniforms({**uniforms, "cells_across": self._cells.across})
            # Drivers may ask for the cells even where a program has them only from an include.
            step.textures.update({**textures, **self._cells.textures})

    def draw(
        self,
        group_starts: npt.NDArray[np.int64],
        group_corners: npt.NDArray[np.float32] | None,
        output: SurfaceTextures,
        corner: tuple[int, int],
    ) -> dict[str, int]:
        """Find the surface; counts of what happened.

        Parameters
        ----------
        group_starts
            (G + 1,): where the groups of balls begin and end.
        group_corners
            (G, 4, 3): the groups' rectangles, see `Groups.corners`; None: all groups are drawn.
        output, corner
            Where the surface goes, and the pixel there that is the lowest and leftmost of this frame.
        """
        self._gl.disable(moderngl.BLEND | moderngl.CULL_FACE)
        self._begin()
        pairs = self._bin(group_starts, group_corners)
        self._enter(pairs)
        counts = {"pairs": pairs.count, "peels": 1 + self._peel(pairs)}
        if self._variant.options.diagnostics:
            counts.update(self._diagnostics(pairs))
        counts["overflows"] = self._count_walkers()
        counts["walks"] = self._walk(pairs) if counts["overflows"] else 0
        self._gather(pairs)
        self._finish(output, corner)
        return counts

    def _state(self) -> moderngl.Texture:
        return self._targets.lists[self._now][0]

    def _turn(self) -> None:
        """What was written is read from now on."""
        self._now = 1 - self._now

    def _begin(self) -> None:
        """Find the kernel spheres, and where rays start inside; set all rays to their start."""
        targets = self._targets
        for framebuffer in targets.search if self._variant.options.diagnostics else ():
            # For the iterations; bits of the float 0 are those of the number 0.
            framebuffer.clear()
        targets.kernel.clear(depth=1.0)
        if self._variant.options.kernel_spheres:
            self._over_balls("kernel", targets.kernel, moderngl.DEPTH_TEST)
        if self._variant.with_starts:
            targets.start.clear()
            self._blend(moderngl.FUNC_ADD)
            self._over_balls("start", targets.start, moderngl.BLEND, kernel_depth_tx=targets.kernel_depth)
        self._over_screen("begin", targets.begin, kernel_depth_tx=targets.kernel_depth, start_tx=targets.start_density)
        self._measure_cells(Phase.PEELING, targets.first_state, targets.first_state)

    def _bin(self, starts: npt.NDArray[np.int64], corners: npt.NDArray[np.float32] | None) -> Pairs:
        """The pairs of balls and cells that may matter."""
        queries = [None] * (len(starts) - 1) if corners is None else self._query_groups(corners)
        ranges = [
            (int(first), int(end - first), query) for first, end, query in zip(starts[:-1], starts[1:], queries, strict=True)
        ]
        step = self._steps["bin"]
        return self._captured(self._workspace.pairs[0], step, ranges)

    def _query_groups(self, corners: npt.NDArray[np.float32]) -> list[OcclusionQuery]:
        """An occlusion query for each group, against the kernel spheres."""
        framebuffer = self._targets.peel[self._now]
        framebuffer.color_mask, framebuffer.depth_mask = (False,) * 4, False
        step = self._steps["group"]
        array = step.vertex_array((self._gl.buffer(corners), "3f", "in_corner"))
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<"
        framebuffer.use()
        queries = self._workspace.queries.take(len(corners))
        for group, query in enumerate(queries):
            with query.asked():
                array.render(moderngl.TRIANGLE_STRIP, 4, first=4 * group)
        framebuffer.color_mask, framebuffer.depth_mask = (True,) * 4, True
        return queries

    def _keep(self, pairs: Pairs, phase: Phase) -> Pairs:
        """Those of the pairs whose cells still ask for them."""
        step = self._steps[f"keep_{phase.name.lower()}"]
        buffers = self._workspace.pairs
        output = buffers[2] if pairs.texture is buffers[1] else buffers[1]
        return self._captured(output, step, [(0, pairs.count, None)], pairs_tx=pairs.texture)

    def _captured(self, output: BufferTexture, step: Step, ranges: Sequence[Range], **textures: Texture) -> Pairs:
        """What a step emits from ranges of points; once more where the buffer was too small."""
        # The cells were drawn last, and must not be read while they are drawn into.
        self._targets.kernel.use()
        step.use_textures(textures)
        count = self._workspace.capture.points(step.vertex_array(), ranges, output.buffer)
        if count > output.capacity:
            output.reserve(count)
            count = self._workspace.capture.points(step.vertex_array(), ranges, output.buffer)
        return Pairs(output, count)

    def _ask_cells(self, phase: Phase) -> None:
        """Measure the cells by the pixels' present states."""
        self._measure_cells(phase, self._state(), self._targets.lists[1 - self._now][0])

    def _measure_cells(self, phase: Phase, state: Texture, older_state: Texture) -> None:
        """What the cells of the image ask for."""
        cells = self._cells
        read = {"state_tx": state, "older_state_tx": older_state, "barrier_tx": self._targets.barrier}
        self._over_screen(f"cells_from_pixels_{phase.name.lower()}", cells.framebuffers[0], **read)
        for level in range(1, len(cells.levels)):
            self._steps["cells_from_cells"].set_uniforms({"smaller_count": cells.factors[level]})
            self._over_screen("cells_from_cells", cells.framebuffers[level], smaller_tx=cells.levels[level - 1])

    def _enter(self, pairs: Pairs) -> None:
        """Peel for the first time: rays enter their first ball or are done."""
        targets = self._targets
        self._over_pairs("peel", targets.peel[0], moderngl.DEPTH_TEST, pairs, state_tx=targets.first_state)
        read = {"state_tx": targets.first_state, "crossing_tx": targets.crossing, "depth_tx": targets.depths[0]}
        self._over_screen("enter", targets.enter, barrier_tx=targets.barrier, **read)
        self._now = 1

    def _peel(self, pairs: Pairs) -> int:
        """Peel and search until nothing is left to peel; how often."""
        targets = self._targets

        def one_peel(pairs: Pairs, query: OcclusionQuery) -> None:
            with query.asked():
                self._over_pairs("peel", targets.peel[self._now], moderngl.DEPTH_TEST, pairs, state_tx=self._state())
            read = {"state_tx": self._state(), "depth_tx": targets.depths[self._now], "crossing_tx": targets.crossing}
            read.update({f"list_{index}_tx": targets.lists[self._now][index] for index in range(1, LIST_TARGETS)})
            if self._variant.options.diagnostics:
                read["iterations_tx"] = targets.iterations[self._now]
            self._over_tiles("search", targets.search[1 - self._now], barrier_tx=targets.barrier, **read)

        return self._until_nothing_is_left(one_peel, pairs, Phase.PEELING)

    def _walk(self, pairs: Pairs) -> int:
        """Walk the rays whose lists were too short until all have arrived; how many steps that took."""
        targets = self._targets
        self._over_screen("begin_walk", targets.state_only[1 - self._now], state_tx=self._state())
        self._turn()

        def one_step(pairs: Pairs, query: OcclusionQuery) -> None:
            targets.walk.clear(0.0, 0.0, 0.0, 2.0)
            with query.asked():
                self._blend(moderngl.FUNC_ADD, moderngl.MIN)
                self._over_pairs("walk_sum", targets.walk, moderngl.BLEND, pairs, state_tx=self._state())
            read = {"state_tx": self._state(), "sums_tx": targets.sums[0], "barrier_tx": targets.barrier}
            self._over_tiles("walk_step", targets.state_only[1 - self._now], **read)

        return self._until_nothing_is_left(one_step, pairs, Phase.WALKING)

    def _until_nothing_is_left(self, one_pass: Callable[[Pairs, OcclusionQuery], None], pairs: Pairs, phase: Phase) -> int:
        """Repeat a pass over the pairs, each only if the pass before has drawn something; how often.

        The processor waits for the graphics processor only once a batch.
        """
        passes = 0
        previous: OcclusionQuery | None = None
        batch = FIRST_BATCH
        while True:
            self._check_cancelled()
            self._ask_cells(phase)
            pairs = self._keep(pairs, phase)
            queries = self._workspace.queries.take(batch)
            before = self._now
            for query in queries:
                with nullcontext() if previous is None else previous.required():
                    one_pass(pairs, query)
                self._turn()
                previous = query
            drawn = [query.answer for query in queries]
            # The first pass that draws no ball is the last that is needed; those after it may have been left out.
            done = len(drawn) if all(drawn) else drawn.index(False) + 1
            self._now = before ^ (done & 1)
            passes += done
            if not all(drawn):
                return passes
            batch = min(2 * batch, LARGEST_BATCH)

    def _count_walkers(self) -> int:
        """How many rays had lists that were too short."""
        query = self._workspace.queries.take(1)[0]
        with query.asked():
            # Anything without colours will do.
            self._over_screen("count_walkers", self._targets.kernel, state_tx=self._state())
        return query.samples

    def _gather(self, pairs: Pairs) -> None:
        """Sum the gradient and the colours at the surface."""
        targets = self._targets
        self._ask_cells(Phase.DONE)
        targets.gather.clear()
        self._blend(moderngl.FUNC_ADD)
        self._over_pairs("gather", targets.gather, moderngl.BLEND, self._keep(pairs, Phase.DONE), state_tx=self._state())

    def _finish(self, output: SurfaceTextures, corner: tuple[int, int]) -> None:
        """Write the surface into its place."""
        output.framebuffer.viewport = (*corner, *self._targets.size)
        self._steps["finish"].set_uniforms({"part_corner": tuple(map(float, corner))})
        sums = self._targets.sums
        self._over_screen("finish", output.framebuffer, state_tx=self._state(), gradient_tx=sums[0], color_sum_tx=sums[1])

    def _diagnostics(self, pairs: Pairs) -> dict[str, int]:
        """Counts that cost time."""
        # No driver reads nothing.
        words = np.frombuffer(pairs.texture.buffer.read(8 * max(pairs.count, 1)), np.uint32).reshape(-1, 2)[: pairs.count]
        width, height = self._targets.size
        iterations = np.frombuffer(self._targets.iterations[self._now].read(), np.uint32).reshape(height, width, 4)
        return {
            "balls_kept": len(np.unique(words[:, 0])),
            "bezier_solves": int(iterations[..., 0].sum()),
            "bezier_iterations": int(iterations[..., 1].sum()),
            "bezier_iterations_max": int(iterations[..., 2].max()),
        }

    def _blend(self, color: int, alpha: int | None = None) -> None:
        """How fragments are summed from now on."""
        self._gl.blend_equation = color, color if alpha is None else alpha
        self._gl.blend_func = moderngl.ONE, moderngl.ONE

    def _over_screen(self, name: str, framebuffer: moderngl.Framebuffer, **textures: Texture) -> None:
        """Draw every pixel once; a depth buffer is written, never asked."""
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "1"
        self._steps[name].draw(framebuffer, moderngl.TRIANGLES, 3, textures)

    def _over_tiles(self, name: str, framebuffer: moderngl.Framebuffer, **textures: Texture) -> None:
        """Draw the pixels of the fine cells that ask for something; a depth buffer is written, never asked."""
        self._gl.enable_only(moderngl.DEPTH_TEST)
        self._gl.depth_func = "1"
        count = self._cells.across * self._cells.down
        self._steps[name].draw(framebuffer, moderngl.TRIANGLES, 6 * count, textures)

    def _over_balls(self, name: str, framebuffer: moderngl.Framebuffer, flags: int, **textures: Texture) -> None:
        """Draw the rectangle of every ball."""
        self._draw_spheres(name, framebuffer, flags, textures, self._ball_count)

    def _over_pairs(self, name: str, framebuffer: moderngl.Framebuffer, flags: int, pairs: Pairs, **textures: Texture) -> None:
        """Draw the part of each pair's ball in its cell."""
        self._draw_spheres(name, framebuffer, flags, {**textures, "pairs_tx": pairs.texture}, pairs.count)

    def _draw_spheres(
        self, name: str, framebuffer: moderngl.Framebuffer, flags: int, textures: dict[str, Texture], count: int
    ) -> None:
        self._gl.enable_only(flags)
        self._gl.depth_func = "<"
        if count:
            self._steps[name].draw(framebuffer, moderngl.TRIANGLES, 6 * count, textures)
