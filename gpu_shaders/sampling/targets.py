"""What methods that sample draw into."""

from __future__ import annotations

import moderngl

from ..context import GpuContext
from ..image_cells import CellTargets, plain


class SamplingTargets:
    """Textures and framebuffers for one size of image; of 32-bit floats, as half floats cannot hold the sums of many balls.

    Attributes
    ----------
    samples
        Four distances for each pixel, see lib/sampling/samples.glsl; `ask` draws into them, and into the depth buffer that
        `density` and `gather` ask.
    sums
        Of densities at the samples; of the gradient, and of each attribute that is summed.
    side
        On which side of the surface the rays start, see lib/sampling/start.frag; `start` draws into it.
    barrier
        Scaled distances of the nearest kernel spheres, 1 where there is none: the surface is not behind, if the ray starts
        outside and no ball has a negative weight. `bar` draws into it.
    brackets
        Two, see lib/sampling/bracket.glsl: `narrow` draws into one while the other is read.
    """

    def __init__(self, context: GpuContext, size: tuple[int, int], summed: int) -> None:
        gl = context.gl
        self.size = size
        self.summed = summed

        def floats(components: int) -> moderngl.Texture:
            return plain(gl.texture(size, components, dtype="f4"))

        self.samples = floats(4)
        self.depth = context.depth_texture(size)
        self.sums = [floats(4) for _ in range(1 + summed)]
        self.side = floats(2)
        self.barrier = context.depth_texture(size)
        self.bar = gl.framebuffer([], self.barrier)
        self.brackets = [floats(4) for _ in range(2)]
        self.dominant = plain(gl.texture(size, 1, dtype="u4"))
        self.ask = gl.framebuffer([self.samples], self.depth)
        self.density = self._asking(gl.framebuffer(self.sums[:1], self.depth))
        self.gather = self._asking(gl.framebuffer(self.sums, self.depth))
        # Drawn into by what is only counted.
        self.counting = gl.framebuffer(self.sums[:1])
        self.counting.color_mask = (False,) * 4
        self.start = gl.framebuffer([self.side])
        self.narrow = [gl.framebuffer([bracket]) for bracket in self.brackets]
        self.dominance = gl.framebuffer([self.dominant], context.depth_texture(size))
        self.cells = CellTargets(gl, size)

    @staticmethod
    def _asking(framebuffer: moderngl.Framebuffer) -> moderngl.Framebuffer:
        """The framebuffer, whose depth is asked and not written."""
        framebuffer.depth_mask = False
        return framebuffer
