"""Particles to an image (section 7.6): the nearest discs, their blend, and the surface that they show."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ....addon.fluid.camera import Camera
from ....addon.render.method import Request
from ...context import GpuContext
from ...image_cells import plain
from ...occlusion import OcclusionQueries
from ...row_texture import row_texture
from ...scene_camera import box_depths, scene_camera_uniforms, scene_depth_scale
from ...step import Step, Texture
from ...surface_textures import SurfaceTextures
from .programs import DrawPrograms
from .simulation import GpuSurfaceParticles

_CORNERS = 6
"""Vertices of a disc's rectangle."""

_ROUNDS = 8
"""Sheets of discs that a ray looks at for the surface: discs reach a little beyond the edges of what they are on."""

_TURNED, _TURNED_TO_EDGE = 0.7, 0.0
"""Cosines by which the surface may turn away from a disc's middle: where discs are blended, and where they only lead to the
surface. There the next sheet is looked at where one leads nowhere, and a tip that is narrower than all discs has no other.
"""

_NOWHERE = 3e38


class DiscPainter:
    """Draws particles; made and used on the context's thread. Programs and targets stay from image to image."""

    def __init__(self, context: GpuContext) -> None:
        self._context, self._queries = context, OcclusionQueries(context)
        self._steps: dict[DrawPrograms, dict[str, Step]] = {}
        self._targets: _Targets | None = None

    def draw(
        self, request: Request, particles: GpuSurfaceParticles, is_exact: bool, camera: Camera, output: SurfaceTextures
    ) -> None:
        """Draw what a camera sees; there are particles."""
        fluid, box = particles.fluid, request.balls.bounds
        # Where all influence spheres begin behind the near clip plane no ray can start in one.
        with_starts = float(np.min(box_depths(box, camera))) <= camera.clip_start * (1 + 1e-6)
        steps = self._steps_for(DrawPrograms(fluid.field.polynomial_kernel, with_starts, request.known_attributes))
        uniforms = {
            **scene_camera_uniforms(box - fluid.anchor, fluid.anchor, camera),
            **fluid.uniforms,
            "particle_count": len(particles),
            "depth_scale": scene_depth_scale(camera, box),
            "is_exact": is_exact,
            "least_cosine": _TURNED_TO_EDGE if is_exact else _TURNED,
        }
        for step in steps.values():
            step.set_uniforms(uniforms)
        targets = self._targets_for(output.size)
        read: dict[str, Texture] = {**fluid.textures, **particles.disc_textures, **targets.textures}
        if "color" in request.known_attributes and request.balls.colors is not None:
            colors = np.column_stack([request.balls.colors, np.ones(len(request.balls), np.float32)])
            read["color_tx"] = row_texture(self._context.gl, colors)
        if with_starts:
            steps["start"].draw_plainly(targets.inside, read)
        output.clear()
        targets.begin()
        self._draw_sheets(steps, targets, output, read, _CORNERS * len(particles), is_exact)

    def forget(self) -> None:
        """Give back what is kept for one size of image."""
        self._targets = None

    def _draw_sheets(
        self,
        steps: Mapping[str, Step],
        targets: _Targets,
        output: SurfaceTextures,
        read: Mapping[str, Texture],
        vertices: int,
        is_exact: bool,
    ) -> None:
        """One sheet of discs after the other while pixels look for the surface; only the first where discs are blended."""
        gl = self._context.gl
        found = gl.framebuffer([*output.textures.values(), targets.beyond])
        gl.depth_func = "<"
        for query in self._queries.take(_ROUNDS if is_exact else 1):
            targets.front.clear(depth=1.0)
            gl.enable_only(moderngl.DEPTH_TEST)
            with query.asked():
                steps["front"].draw(targets.front, moderngl.TRIANGLES, vertices, read)
            with query.required():
                if not is_exact:
                    targets.sums.clear()
                    gl.enable_only(moderngl.BLEND)
                    gl.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
                    gl.blend_func = moderngl.ONE, moderngl.ONE
                    steps["blend"].draw(targets.sums, moderngl.TRIANGLES, vertices, read)
                steps["finish"].draw_plainly(found, read)

    def _steps_for(self, variant: DrawPrograms) -> dict[str, Step]:
        if variant not in self._steps:
            self._steps[variant] = {name: Step(self._context, source) for name, source in variant.programs().items()}
        return self._steps[variant]

    def _targets_for(self, size: tuple[int, int]) -> _Targets:
        if self._targets is None or self._targets.size != size:
            self._targets = None  # its memory may be needed
            self._targets = _Targets(self._context, size)
        return self._targets


class _Targets:
    """What is drawn into beside the surface, for one size of image."""

    def __init__(self, context: GpuContext, size: tuple[int, int]) -> None:
        gl = context.gl
        self.size = size
        front = context.depth_texture(size)
        normals, ways, insides, beyond = (plain(gl.texture(size, components, dtype="f4")) for components in (4, 1, 1, 1))
        self.textures = {
            "front_tx": front,
            "normal_sum_tx": normals,
            "way_sum_tx": ways,
            "inside_tx": insides,
            "beyond_tx": beyond,
        }
        self.front = gl.framebuffer([], front)
        self.sums = gl.framebuffer([normals, ways])
        self.inside = gl.framebuffer([insides])
        self.beyond = beyond
        self._beginning = gl.framebuffer([beyond])

    def begin(self) -> None:
        """No ray has looked at anything yet."""
        self._beginning.clear(red=-_NOWHERE)
