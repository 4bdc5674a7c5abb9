"""What Depth Peeling draws into."""

from __future__ import annotations

import moderngl

from ...buffer_texture import BufferTexture
from ...capture import Capture
from ...context import GpuContext
from ...image_cells import CellTargets, plain
from ...occlusion import OcclusionQueries
from .programs import LIST_TARGETS

FIRST_PAIRS = 2**16
"""Room for pairs to begin with; it grows."""


class Workspace:
    """What is kept from frame to frame on a context; use it within :meth:`GpuContext.run`.

    Attributes
    ----------
    capture, queries
        Transform feedback and occlusion queries.
    pairs
        Of balls and cells: all, and two for those that are left of them.
    """

    def __init__(self, context: GpuContext) -> None:
        self.capture = Capture(context)
        self.queries = OcclusionQueries(context)
        self.pairs = [BufferTexture(context, FIRST_PAIRS) for _ in range(3)]
        self._context = context
        self._targets: Targets | None = None

    def targets(self, size: tuple[int, int], with_iterations: bool) -> Targets:
        """The images of this size, new ones where the last were of another."""
        if self._targets is None or (self._targets.size, self._targets.with_iterations) != (size, with_iterations):
            self._targets = Targets(self._context, size, with_iterations)
        return self._targets


class Targets:
    """Textures and framebuffers for one size of image. Of what is read while its successor is written there are two."""

    def __init__(self, context: GpuContext, size: tuple[int, int], with_iterations: bool) -> None:
        gl = context.gl
        self.size = size
        self.with_iterations = with_iterations

        def words(components: int) -> moderngl.Texture:
            return plain(gl.texture(size, components, dtype="u4"))

        def floats(components: int) -> moderngl.Texture:
            return plain(gl.texture(size, components, dtype="f4"))

        self.kernel_depth = context.depth_texture(size)
        self.start_density = floats(2)
        self.barrier = floats(1)
        self.crossing = words(1)
        self.depths = [context.depth_texture(size) for _ in range(2)]
        self.lists = [[words(4) for _ in range(LIST_TARGETS)] for _ in range(2)]
        self.iterations = [words(4) for _ in range(2)] if with_iterations else []
        self.sums = [floats(4) for _ in range(2)]
        self.kernel = gl.framebuffer([], self.kernel_depth)
        self.start = gl.framebuffer([self.start_density])
        # Before the first peel the state lies where later the second texel of the list does.
        self.first_state = self.lists[0][1]
        self.begin = gl.framebuffer([self.first_state, self.barrier], self.depths[0])
        self.enter = gl.framebuffer([self.lists[0][0], self.lists[1][0]], self.depths[1])
        self.peel = [gl.framebuffer([self.crossing], depth) for depth in self.depths]
        self.search = [
            gl.framebuffer([*self.lists[index], *self.iterations[index : index + 1]], self.depths[index]) for index in range(2)
        ]
        self.state_only = [gl.framebuffer(targets[:1]) for targets in self.lists]
        self.walk = gl.framebuffer(self.sums[:1])
        self.gather = gl.framebuffer(self.sums)
        self.cells = CellTargets(gl, size)
