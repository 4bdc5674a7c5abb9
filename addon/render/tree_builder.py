"""Trees for a sequence of frames: the next one is built while the one before is drawn (Gourmel et al. 2010, figure 7)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as StillBuilding
from contextlib import suppress
from dataclasses import dataclass
from threading import Event, Lock

from ..fluid.balls import Balls
from ..fluid.errors import CancelledError, MeniscusError
from ..fluid.field import Field
from .fitted_bvh import FittedBvh, TreeArrays

_LOOKS_A_SECOND = 50
"""How often one who waits looks whether the user gave up."""


@dataclass(frozen=True, eq=False)
class BuiltTree:
    """A tree over balls, as a GPU takes it.

    Attributes
    ----------
    balls, field
        What it is made of.
    arrays
        The tree.
    seconds
        How long it took to build.
    """

    balls: Balls
    field: Field
    arrays: TreeArrays
    seconds: float


@dataclass(frozen=True, eq=False)
class _Order:
    """A tree that is being built."""

    balls: Balls
    field: Field
    is_given_up: Event
    tree: Future[BuiltTree]
    is_awaited: Event = dataclasses.field(default_factory=Event)

    def is_of(self, balls: Balls, fluid_field: Field) -> bool:
        return self.balls is balls and self.field == fluid_field


class TreeBuilder:
    """Builds trees on a thread of its own, one at a time, and keeps the last; its methods may be called from any thread.

    Parameters
    ----------
    hierarchy
        The kind of tree, see :class:`fitted_bvh.FittedBvh`.
    """

    def __init__(self, hierarchy: str = "fitted") -> None:
        self._hierarchy = hierarchy
        self._lock = Lock()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="meniscus-tree")
        self._order: _Order | None = None

    def expect(self, balls: Balls, fluid_field: Field, threads: int = 0) -> None:
        """Begin to build a tree; one of other balls that nobody waits for is given up.

        Parameters
        ----------
        balls, fluid_field
            What it is to be made of.
        threads
            That work on it, 0 for one a core.
        """
        self._ordered(balls, fluid_field, threads)

    def tree(self, balls: Balls, fluid_field: Field, threads: int, watch: Callable[[float], None]) -> BuiltTree:
        """The tree over these balls: at once where it was built before, else when it is ready.

        Parameters
        ----------
        balls, fluid_field, threads
            As for :meth:`expect`.
        watch
            Is called now and then while it waits; what it raises is passed on.

        Raises
        ------
        MeniscusError
            It cannot be built.
        """
        order = self._ordered(balls, fluid_field, threads, is_awaited=True)
        try:
            while True:
                watch(0.0)
                with suppress(StillBuilding):
                    return order.tree.result(1 / _LOOKS_A_SECOND)
        except MeniscusError:
            self._leave(order)
            raise

    def forget(self) -> None:
        """Give back the memory of the tree that is kept."""
        with self._lock:
            self._order = None

    def _ordered(self, balls: Balls, fluid_field: Field, threads: int, is_awaited: bool = False) -> _Order:
        """What is being built, or was, of these balls; it is begun where there is none."""
        with self._lock:
            order = self._order
            if order is None or not order.is_of(balls, fluid_field) or _has_failed(order):
                if order is not None and not order.is_awaited.is_set():
                    order.is_given_up.set()
                is_given_up = Event()
                tree = self._thread.submit(self._build, balls, fluid_field, threads, is_given_up)
                order = self._order = _Order(balls, fluid_field, is_given_up, tree)
            if is_awaited:
                order.is_awaited.set()
            return order

    def _leave(self, order: _Order) -> None:
        """Nobody waits for it any more."""
        with self._lock:
            order.is_awaited.clear()
            if order is not self._order:
                order.is_given_up.set()

    def _build(self, balls: Balls, fluid_field: Field, threads: int, is_given_up: Event) -> BuiltTree:
        def watch(_: float) -> None:
            if is_given_up.is_set():
                raise CancelledError("Newer balls are to be shown")

        watch(0.0)
        start = time.perf_counter()
        tree = FittedBvh(balls, fluid_field, hierarchy=self._hierarchy, threads=threads, watch=watch)
        return BuiltTree(balls, fluid_field, tree.arrays(), time.perf_counter() - start)


def _has_failed(order: _Order) -> bool:
    return order.tree.done() and order.tree.exception() is not None


TREES = TreeBuilder()
"""Builds the fitted trees of whatever wants any, so that it is one for the surface and for its light."""
