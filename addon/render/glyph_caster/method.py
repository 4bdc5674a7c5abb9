"""Hands glyphs and the camera to the native core."""

from __future__ import annotations

import numpy as np

from ...fluid.passes import DEPTH_BACKGROUND
from .. import native
from ..glyphs import glyphs_of
from ..method import Request, Surface, timed, unfilled_surface


class GlyphCaster:
    """See :mod:`glyph_caster`."""

    def __init__(self) -> None:
        self._native = native.load()

    @property
    def device(self) -> str:
        """See :func:`native.device`."""
        return native.device()

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        surface = unfilled_surface(request)
        with timed(surface.milliseconds, "build"):
            glyphs = glyphs_of(request)
        names = surface.ball
        if names is None:
            names = request.memory.empty(surface.depth.shape, np.int32)
        pairs = ((glyphs.colors, surface.color), (glyphs.velocities, surface.velocity))
        with native.translated_errors(), timed(surface.milliseconds, "cast"):
            self._native.cast_glyphs(
                glyphs.centers,
                glyphs.extents,
                glyphs.balls,
                surface.depth,
                surface.normal,
                names,
                background=DEPTH_BACKGROUND,
                **native.view_arguments(request.camera),
                attributes=[(source, target) for source, target in pairs if source is not None and target is not None],
                threads=request.threads,
                watch=request.watch,
            )
        surface.counts = {"glyphs": len(glyphs), "balls_without_surface": glyphs.without_surface}
        return surface


def create() -> GlyphCaster:
    """The method, ready to run; raises DeviceError where the native core is missing."""
    return GlyphCaster()
