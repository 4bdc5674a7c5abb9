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

_NOWHERE = 3e38


class Drawing:
    """Draws the particles of a frame; made and used on the context's thread."""

    def __init__(self, context: GpuContext, request: Request, particles: GpuSurfaceParticles, is_exact: bool) -> None:
        self._context, self._particles, self._is_exact = context, particles, is_exact
        self._queries = OcclusionQueries(context)
        self._attributes, self._box = request.known_attributes, request.balls.bounds
        self._textures: dict[str, Texture] = {**particles.fluid.textures, **particles.disc_textures}
        if "color" in self._attributes and request.balls.colors is not None:
            colors = np.column_stack([request.balls.colors, np.ones(len(request.balls), np.float32)])
            self._textures["color_tx"] = row_texture(context.gl, colors)

    def draw(self, camera: Camera, output: SurfaceTextures) -> None:
        """Draw what a camera sees."""
        fluid = self._particles.fluid
        # Where all influence spheres begin behind the near clip plane no ray can start in one.
        with_starts = float(np.min(box_depths(self._box, camera))) <= camera.clip_start * (1 + 1e-6)
        programs = DrawPrograms(fluid.field.polynomial_kernel, with_starts, self._attributes).programs()
        steps = {name: Step(self._context, source) for name, source in programs.items()}
        uniforms = {
            **scene_camera_uniforms(self._box - fluid.anchor, fluid.anchor, camera),
            **fluid.uniforms,
            "particle_count": len(self._particles),
            "depth_scale": scene_depth_scale(camera, self._box),
            "is_exact": self._is_exact,
        }
        for step in steps.values():
            step.set_uniforms(uniforms)
        targets = _Targets(self._context, output)
        if with_starts:
            steps["start"].draw_plainly(targets.inside, self._textures)
        output.clear()
        read: dict[str, Texture] = {**self._textures, **targets.textures}
        for query in self._queries.take(_ROUNDS if self._is_exact else 1):
            targets.front.clear(depth=1.0)
            with query.asked():
                self._over_discs(steps["front"], targets.front, moderngl.DEPTH_TEST, read)
            with query.required():
                if not self._is_exact:
                    self._blend(steps["blend"], targets, read)
                steps["finish"].draw_plainly(targets.found, read)

    def _blend(self, step: Step, targets: _Targets, read: Mapping[str, Texture]) -> None:
        gl = self._context.gl
        targets.sums.clear()
        gl.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
        gl.blend_func = moderngl.ONE, moderngl.ONE
        self._over_discs(step, targets.sums, moderngl.BLEND, read)

    def _over_discs(self, step: Step, framebuffer: moderngl.Framebuffer, flags: int, textures: Mapping[str, Texture]) -> None:
        gl = self._context.gl
        gl.enable_only(flags)
        gl.depth_func = "<"
        step.draw(framebuffer, moderngl.TRIANGLES, _CORNERS * len(self._particles), textures)


class _Targets:
    """What is drawn into beside the surface, for one size of image."""

    def __init__(self, context: GpuContext, output: SurfaceTextures) -> None:
        gl, size = context.gl, output.size
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
        self.found = gl.framebuffer([*output.textures.values(), beyond])
        # Rays begin before all that there is.
        gl.framebuffer([beyond]).clear(red=-_NOWHERE)
