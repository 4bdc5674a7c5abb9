"""How long the graphics processor takes for each stage of an image."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import moderngl

from .context import GpuContext


class StageTimes:
    """How long each stage takes: by the graphics processor's timers, or by the clock where OpenGL is software."""

    def __init__(self, context: GpuContext) -> None:
        self._context = context
        self._queries: dict[str, moderngl.Query] = {}
        self._seconds: dict[str, float] = {}

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Measure a stage."""
        gl = self._context.gl
        if self._context.is_software:  # its timers know nothing of compute shaders
            gl.finish()
            start = time.perf_counter()
            yield
            gl.finish()
            self._seconds[stage] = time.perf_counter() - start
        else:
            self._queries[stage] = query = gl.query(time=True)
            with query:
                yield

    @property
    def milliseconds(self) -> dict[str, float]:
        """By stage; waits for them."""
        by_timers = {stage: query.elapsed / 1e6 for stage, query in self._queries.items()}
        return by_timers or {stage: 1e3 * seconds for stage, seconds in self._seconds.items()}
