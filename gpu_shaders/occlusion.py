"""Occlusion queries that later draws depend on, without the processor knowing the answer.

moderngl's own queries only offer conditional rendering that does not wait for the answer: then the graphics processor draws
whatever has not been answered yet, which just after asking is everything.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

from .context import GpuContext

# Not GL_ANY_SAMPLES_PASSED, by whose answers llvmpipe (Mesa 22) never leaves anything out.
_GL_SAMPLES_PASSED = 0x8914
_GL_QUERY_RESULT = 0x8866
_GL_QUERY_WAIT = 0x8E13


class OcclusionQueries:
    """Queries of one context, kept until it ends; use them within :meth:`GpuContext.run`."""

    def __init__(self, context: GpuContext) -> None:
        unsigned, pointer = ctypes.c_uint, ctypes.c_void_p
        self._generate = context.function("glGenQueries", ctypes.c_int, pointer)
        self._begin = context.function("glBeginQuery", unsigned, unsigned)
        self._end = context.function("glEndQuery", unsigned)
        self._get = context.function("glGetQueryObjectuiv", unsigned, unsigned, pointer)
        self._begin_condition = context.function("glBeginConditionalRender", unsigned, unsigned)
        self._end_condition = context.function("glEndConditionalRender")
        self._names: list[int] = []

    def take(self, count: int) -> list[OcclusionQuery]:
        """The first `count` queries; whoever takes them next takes the same ones."""
        missing = count - len(self._names)
        if missing > 0:
            names = (ctypes.c_uint * missing)()
            self._generate(missing, names)
            self._names += names
        return [OcclusionQuery(self, name) for name in self._names[:count]]


class OcclusionQuery:
    """Whether what is drawn leaves any sample."""

    def __init__(self, queries: OcclusionQueries, name: int) -> None:
        self._queries = queries
        self._name = name

    @contextmanager
    def asked(self) -> Iterator[None]:
        """Ask of what the block draws."""
        self._queries._begin(_GL_SAMPLES_PASSED, self._name)
        yield
        self._queries._end(_GL_SAMPLES_PASSED)

    @contextmanager
    def required(self) -> Iterator[None]:
        """What the block draws is left out where the answer is no; the graphics processor waits for it, nobody else."""
        self._queries._begin_condition(self._name, _GL_QUERY_WAIT)
        yield
        self._queries._end_condition()

    @property
    def samples(self) -> int:
        """How many there were; waits until that is known."""
        result = ctypes.c_uint()
        self._queries._get(self._name, _GL_QUERY_RESULT, ctypes.byref(result))
        return result.value

    @property
    def answer(self) -> bool:
        """Whether there were samples; waits until that is known."""
        return self.samples > 0
