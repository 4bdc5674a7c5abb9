"""Runs the shaders of Glyphs; see the package for what it does."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
import numpy.typing as npt

from ....addon.fluid.camera import Camera, Region
from ....addon.fluid.errors import InputError
from ....addon.render.glyphs import Glyphs, ViewGlyphs, glyphs_of, in_view
from ....addon.render.method import Attribute, Request, Surface, timed
from ...camera_parts import camera_uniforms, image_parts
from ...context import GpuContext, shared_context
from ...programs import ROW_TEXTURE_WIDTH
from ...row_texture import row_texture
from ...step import Step
from ...surface_textures import SurfaceTextures
from .params import METHOD
from .programs import Variant

_PIXELS_A_PART = 2**23


class GlyphsMethod:
    """The method on one OpenGL context."""

    def __init__(self, context: GpuContext) -> None:
        # Depth, normal and the attributes; glyphs fill a square texture at most.
        context.require(METHOD.gl_version, 2 + len(METHOD.attributes), ROW_TEXTURE_WIDTH)
        self._context = context
        # A driver that rejects the shaders is to be known before the method is chosen.
        context.run(lambda: [Step(context, Variant(are_spheres).nearest()) for are_spheres in (False, True)])

    @property
    def device(self) -> str:
        """What the driver calls the graphics processor."""
        return str(self._context.renderer)

    @property
    def shares_textures(self) -> bool:
        """See :meth:`method.DeviceMethod.shares_textures`."""
        return self._context.shares

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        surface = Surface.background(request.camera, request.known_attributes)
        seen = self._seen(request, surface.milliseconds)
        surface.counts = _counts(seen)
        if len(seen):
            limits = self._context.limits
            with timed(surface.milliseconds, "surface"):
                for region in image_parts(request.camera, _PIXELS_A_PART, min(limits.texture_size, limits.viewport_size)):
                    request.watch(region.y_min / request.camera.height)
                    self._context.run(partial(self._draw_and_read, seen, request, region, surface))
        return surface

    def find_surface_on_device(self, request: Request) -> SurfaceTextures:
        """See :meth:`method.DeviceMethod.find_surface_on_device`."""
        camera = request.camera
        self._context.require(METHOD.gl_version, texture_size=max(camera.width, camera.height))
        milliseconds: dict[str, float] = {}
        seen = self._seen(request, milliseconds)
        with timed(milliseconds, "surface"):
            textures = self._context.run(lambda: self._draw_on_device(seen, request))
        textures.add_report(milliseconds, _counts(seen))
        return textures

    def _seen(self, request: Request, milliseconds: dict[str, float]) -> ViewGlyphs:
        """The glyphs in the view; InputError where they are too many."""
        with timed(milliseconds, "glyphs"):
            seen = in_view(glyphs_of(request), request.camera)
        most = ROW_TEXTURE_WIDTH * self._context.limits.texture_size // (1 if seen.glyphs.are_spheres else 4)
        if len(seen) > most:
            raise InputError(f"{len(seen)} glyphs meet the view but {METHOD.label} takes at most {most} here; show fewer")
        return seen

    def _draw_on_device(self, seen: ViewGlyphs, request: Request) -> SurfaceTextures:
        """On the context's thread."""
        camera = request.camera
        textures = self._draw_part(seen, request, Region(0, 0, camera.width, camera.height))
        # Another context sees what is finished; it could not wait for what is not.
        self._context.gl.finish()
        return textures

    def _draw_and_read(self, seen: ViewGlyphs, request: Request, region: Region, surface: Surface) -> None:
        """Fill a region of `surface`; on the context's thread."""
        self._draw_part(seen, request, region).read_into(surface, region)

    def _draw_part(self, seen: ViewGlyphs, request: Request, region: Region) -> SurfaceTextures:
        """Draw a region of the image; on the context's thread."""
        camera = replace(request.camera, region=region).cropped()
        textures = SurfaceTextures(self._context, (camera.width, camera.height), request.known_attributes)
        if len(seen):
            _Drawing(self._context, seen, request.known_attributes).draw(camera, textures)
        else:
            textures.clear()
        return textures


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
    """A power of two, so that scaling loses nothing, which brings all planar depths below 1."""
    farthest = float(np.max(seen.glyphs.reaches[seen.chosen] - seen.centers[:, 2]))
    return 2.0 ** -(math.ceil(math.log2(farthest)) + 1)


def _counts(seen: ViewGlyphs) -> dict[str, int]:
    glyphs = seen.glyphs
    return {"glyphs": len(glyphs), "glyphs_drawn": len(seen), "balls_without_surface": glyphs.without_surface}


def create() -> GlyphsMethod:
    """The method on the process's context; raises DeviceError where there is none that can run it."""
    return shared_context().kept(GlyphsMethod)
