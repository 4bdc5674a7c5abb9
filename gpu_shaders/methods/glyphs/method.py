"""Runs the shaders of Glyphs; see the package for what it does."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera
from ....addon.fluid.errors import InputError
from ....addon.render.glyphs import Glyphs, ViewGlyphs, glyphs_of, in_view
from ....addon.render.method import Attribute, Request, timed
from ...camera_parts import camera_uniforms, depth_scale
from ...context import GpuContext, shared_context
from ...parted_method import PartedMethod
from ...programs import ROW_TEXTURE_WIDTH
from ...row_texture import row_texture
from ...step import Step
from ...surface_textures import SurfaceTextures
from .params import METHOD
from .programs import Variant


class GlyphsMethod(PartedMethod[ViewGlyphs]):
    """The method on one OpenGL context."""

    def __init__(self, context: GpuContext) -> None:
        # Depth, normal and the attributes; glyphs fill a square texture at most.
        context.require(METHOD.gl_version, 2 + len(METHOD.attributes), ROW_TEXTURE_WIDTH)
        super().__init__(context, METHOD)
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: [Step(context, Variant(are_spheres).nearest()) for are_spheres in (False, True)])

    def scene_of(self, request: Request, milliseconds: dict[str, float]) -> ViewGlyphs:
        """The glyphs in the view; InputError where they are too many."""
        with timed(milliseconds, "glyphs"):
            seen = in_view(glyphs_of(request), request.camera)
        most = ROW_TEXTURE_WIDTH * self._context.limits.texture_size // (1 if seen.glyphs.are_spheres else 4)
        if len(seen) > most:
            raise InputError(f"{len(seen)} glyphs meet the view but {METHOD.label} takes at most {most} here; show fewer")
        return seen

    def counts_of(self, scene: ViewGlyphs) -> Mapping[str, int]:
        """See :meth:`PartedMethod.counts_of`."""
        glyphs = scene.glyphs
        return {"glyphs": len(glyphs), "glyphs_drawn": len(scene), "balls_without_surface": glyphs.without_surface}

    def fill(self, request: Request, scene: ViewGlyphs, camera: Camera, textures: SurfaceTextures) -> None:
        """See :meth:`PartedMethod.fill`."""
        if len(scene):
            _Drawing(self._context, scene, request.known_attributes).draw(camera, textures)
        else:
            textures.clear()


class _Drawing:
    """The glyphs of a frame on the graphics processor; made and used on the context's thread."""

    def __init__(self, context: GpuContext, seen: ViewGlyphs, attributes: tuple[Attribute, ...]) -> None:
        variant = Variant(seen.glyphs.are_spheres, attributes)
        self._context, self._count = context, len(seen)
        self._nearest, self._finish = Step(context, variant.nearest()), Step(context, variant.finish())
        self._depth_scale = _depth_scale(seen)
        self._textures = {
            name: row_texture(context.gl, rows)
            for name, rows in {"glyph_tx": _texels(seen), **_attribute_rows(seen.glyphs, seen.chosen, attributes)}.items()
        }

    def draw(self, camera: Camera, output: SurfaceTextures) -> None:
        """Draw what a camera sees."""
        gl, size = self._context.gl, output.size
        uniforms = {**camera_uniforms(camera), "depth_scale": self._depth_scale}
        numbers = gl.texture(size, 1, dtype="u4")
        numbers.filter = (moderngl.NEAREST, moderngl.NEAREST)
        target = gl.framebuffer([numbers], self._context.depth_texture(size))
        # The bits of the float 0 are those of the number 0.
        target.clear(depth=1.0)
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = "<"
        self._nearest.set_uniforms(uniforms)
        self._nearest.draw(target, moderngl.TRIANGLES, 6 * self._count, self._textures)
        self._finish.set_uniforms(uniforms)
        self._finish.draw_plainly(output.framebuffer, {**self._textures, "number_tx": numbers})


def _texels(seen: ViewGlyphs) -> npt.NDArray[np.float32]:
    """(M, 4) or (4 M, 4), see glyph.glsl."""
    if seen.axes is None:
        return np.column_stack([seen.centers, seen.glyphs.extents[seen.chosen]]).astype(np.float32)
    lengths = np.linalg.norm(seen.axes, axis=2, keepdims=True)
    texels = np.zeros((len(seen), 4, 4), np.float32)
    texels[:, 0, :3] = seen.centers
    texels[:, 1:] = np.concatenate([seen.axes / lengths, lengths], axis=2)
    return texels.reshape(-1, 4)


def _attribute_rows(
    glyphs: Glyphs, chosen: npt.NDArray[np.int64], attributes: tuple[Attribute, ...]
) -> dict[str, npt.NDArray[np.float32] | npt.NDArray[np.int32]]:
    """The glyphs' attributes by sampler name."""
    rows: dict[str, npt.NDArray[np.float32] | npt.NDArray[np.int32]] = {}
    for name, values in (("color", glyphs.colors), ("velocity", glyphs.velocities)):
        if name in attributes and values is not None:
            # Textures of three channels are slow, or none, on some drivers.
            rows[f"{name}_tx"] = np.column_stack([values[chosen], np.ones(len(chosen), np.float32)])
    if "ball" in attributes:
        rows["ball_tx"] = glyphs.balls[chosen, None]
    return rows


def _depth_scale(seen: ViewGlyphs) -> float:
    """Of planar depths."""
    return depth_scale(float(np.max(seen.glyphs.reaches[seen.chosen] - seen.centers[:, 2])))


def create() -> GlyphsMethod:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(GlyphsMethod)
