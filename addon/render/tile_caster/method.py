"""Hands the fluid and the camera to the native core."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...fluid.passes import DEPTH_BACKGROUND
from .. import native
from ..method import Request, Surface, timed, unfilled_surface

# Every fourth pixel along both axes, then every second, then all.
_STRIDES = (4, 2, 1)


class TileCaster:
    """See :mod:`tile_caster`."""

    def __init__(self) -> None:
        self._native = native.load()

    @property
    def device(self) -> str:
        """See :func:`native.device`."""
        return native.device()

    def find_surface(self, request: Request) -> Surface:
        """See :meth:`method.Method.find_surface`."""
        return next(self._surfaces(request, (1,)))

    def find_surfaces(self, request: Request) -> Iterator[Surface]:
        """See :meth:`method.ProgressiveMethod.find_surfaces`."""
        return self._surfaces(request, _STRIDES)

    def _surfaces(self, request: Request, strides: tuple[int, ...]) -> Iterator[Surface]:
        """The surface at every `stride`-th pixel, which also stands for those between, one after the other."""
        milliseconds: dict[str, float] = {}
        with native.translated_errors(), timed(milliseconds, "build"):
            caster = self._caster(request)
        counts = {"balls_drawn": caster.seen, "tile_entries": caster.tile_entries}
        for stride in strides:
            surface = unfilled_surface(request)
            with native.translated_errors(), timed(milliseconds, "cast"):
                self._cast(caster, request, surface, stride)
            surface.milliseconds, surface.counts = dict(milliseconds), dict(counts)
            yield surface

    def _caster(self, request: Request) -> Any:
        return self._native.TileCaster(
            *native.fluid_arguments(request.balls, request.field),
            **native.view_arguments(request.camera),
            threads=request.threads,
            watch=request.watch,
        )

    def _cast(self, caster: Any, request: Request, surface: Surface, stride: int) -> None:
        balls = request.balls
        pairs = ((balls.colors, surface.color), (balls.velocities, surface.velocity))
        caster.cast(
            surface.depth,
            surface.normal,
            background=DEPTH_BACKGROUND,
            stride=stride,
            ball=surface.ball,
            attributes=[(source, target) for source, target in pairs if source is not None and target is not None],
            threads=request.threads,
            watch=request.watch,
        )


def create() -> TileCaster:
    """The method, ready to run; raises DeviceError where the native core is missing."""
    return TileCaster()
