"""The connected liquids of a fluid by number, and their colours (Mueller, Grottel and Ertl 2007, figure 1).

What was found of some balls is kept as long as they are, so that it is found once a frame, whoever asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.field import Field
from ..fluid.look import Look
from ..fluid.palette import numbered_colors
from . import native
from .clusters import find_clusters

Watch = Callable[[float], object]


@dataclass(frozen=True, eq=False)
class ClusterNumbers:
    """Which liquid each ball belongs to.

    Attributes
    ----------
    numbers
        (N,) int32: 1 for the liquid of the most balls, 2 for the next one and so on, of equals that of the first ball first; 0
        for a ball whose centre is not in the fluid.
    sizes
        (C,) int64: how many balls the liquids 1, 2 ... have.
    """

    numbers: npt.NDArray[np.int32]
    sizes: npt.NDArray[np.int64]

    @property
    def counts(self) -> dict[str, int]:
        """How many liquids there are, how many balls the largest has, and how many have one ball alone."""
        return {
            "clusters": len(self.sizes),
            "largest_cluster": int(self.sizes[0]) if len(self.sizes) else 0,
            "lone_droplets": int(np.count_nonzero(self.sizes == 1)),
        }


@dataclass(frozen=True, eq=False)
class _Colored:
    """Balls with the colours of their liquids, in one field, where they come from some sources."""

    field: Field
    sources: frozenset[int] | None
    balls: Balls


_numbered: WeakKeyDictionary[Balls, tuple[Field, ClusterNumbers]] = WeakKeyDictionary()
_colored: WeakKeyDictionary[Balls, _Colored] = WeakKeyDictionary()


def number_clusters(balls: Balls, field: Field, *, threads: int = 0, watch: Watch = native.let_interrupt) -> ClusterNumbers:
    """Number the connected liquids, the largest first.

    The parameters and the errors are those of :func:`clusters.find_clusters`.
    """
    known = _numbered.get(balls)
    if known is None or known[0] != field:
        found = find_clusters(balls, field, threads=threads, watch=watch)
        order = np.argsort(-found.sizes.astype(np.int64), kind="stable")
        # The last one is that of NO_CLUSTER, -1.
        ranks = np.zeros(len(order) + 1, np.int32)
        ranks[order] = np.arange(1, len(order) + 1)
        known = field, ClusterNumbers(ranks[found.labels], found.sizes[order].astype(np.int64))
        _numbered[balls] = known
    return known[1]


def known_counts(balls: Balls, field: Field) -> dict[str, int]:
    """:attr:`ClusterNumbers.counts` where somebody has asked for the numbers of these balls, else nothing."""
    known = _numbered.get(balls)
    return known[1].counts if known is not None and known[0] == field else {}


def colored_by_cluster(
    balls: Balls,
    field: Field,
    sources: Collection[int] | None = None,
    *,
    threads: int = 0,
    watch: Watch = native.let_interrupt,
) -> Balls:
    """The same balls with the colours of their liquids, see :func:`palette.numbered_colors`.

    Parameters
    ----------
    balls, field
        The fluid. All its balls make the liquids, whatever they come from.
    sources
        Whose balls take these colours, see :attr:`balls.Balls.sources`; None for all. The others keep theirs.
    threads, watch
        As for :func:`clusters.find_clusters`, with its errors.

    Returns
    -------
    Balls that are the same ones each time for the same arguments, and share all arrays but the colours.
    """
    chosen = None if sources is None else frozenset(sources)
    known = _colored.get(balls)
    if known is None or (known.field, known.sources) != (field, chosen):
        found = number_clusters(balls, field, threads=threads, watch=watch)
        colors = numbered_colors(found.numbers)
        if chosen is not None:
            keeps = ~_come_from(balls, chosen)
            colors[keeps] = np.array(Look().color, np.float32) if balls.colors is None else balls.colors[keeps]
        known = _colored[balls] = _Colored(field, chosen, balls.with_colors(colors))
        _numbered[known.balls] = field, found
    return known.balls


def _come_from(balls: Balls, sources: frozenset[int]) -> npt.NDArray[np.bool_]:
    if balls.sources is None:
        return np.full(len(balls), 0 in sources)
    return np.isin(balls.sources, list(sources))
