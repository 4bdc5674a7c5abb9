"""One image on its way through the shaders of Equal Interval."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext

import moderngl

from ....addon.render.settings import Value
from ...context import GpuContext
from ...image_cells import plain
from ...occlusion import OcclusionQueries, OcclusionQuery
from ...sampling.passes import SamplingPasses
from ...sampling.targets import SamplingTargets
from .params import GRACE

BATCH, ADAPTIVE_BATCH = 16, 4
"""Rounds between two looks at what is left, for which the processor waits; with the adaptive interval most rays need few, and
some many. The paper's 32 samples, and the 64 after which it saw no holes, are one batch.
"""
SAMPLES_A_ROUND = 4
_NOTHING_AHEAD = 3e38


class MarchTargets:
    """What this method draws into beside the shared targets.

    Attributes
    ----------
    marches
        Two, see march.glsl: `advance` draws into one, and into the bracket of the same number, while the others are read.
    next
        What lies ahead, see next.frag; `ahead` draws into it.
    """

    def __init__(self, context: GpuContext, shared: SamplingTargets) -> None:
        gl = context.gl
        self.shared = shared
        self.marches = [plain(gl.texture(shared.size, 4, dtype="f4")) for _ in range(2)]
        self.next = plain(gl.texture(shared.size, 4, dtype="f4"))
        pairs = zip(self.marches, shared.brackets, strict=True)
        self.advance = [gl.framebuffer([march, bracket], shared.depth) for march, bracket in pairs]
        self.ahead = gl.framebuffer([self.next], shared.depth)
        self.ahead.depth_mask = False


class Frame:
    """Finds where the rays of one image meet the surface; on the context's thread.

    Parameters
    ----------
    passes, targets
        Where to draw.
    queries
        For the occlusion queries.
    settings
        The method's.
    check_cancelled
        Called between batches; may raise.
    """

    def __init__(
        self,
        passes: SamplingPasses,
        targets: MarchTargets,
        queries: OcclusionQueries,
        settings: Mapping[str, Value],
        check_cancelled: Callable[[], None],
    ) -> None:
        self._passes, self._targets, self._queries = passes, targets, queries
        self._check_cancelled = check_cancelled
        limit = int(settings["samples"])
        is_adaptive = bool(settings["adaptive"])
        most_samples = GRACE * limit if is_adaptive else limit
        self._rounds = -(-most_samples // SAMPLES_A_ROUND)
        self._batch = ADAPTIVE_BATCH if is_adaptive else BATCH
        passes.steps["advance"].set_uniforms({"most_samples": most_samples})

    def march(self) -> dict[str, int]:
        """Take samples until all rays have stopped; counts of what happened."""
        self._passes.over_screen("begin_march", self._targets.advance[self._passes.now])
        counts = {"rounds": 0, "samples": 0}
        previous: OcclusionQuery | None = None
        asking = [1]
        while counts["rounds"] < self._rounds and asking[-1]:
            self._check_cancelled()
            queries = self._queries.take(min(self._batch, self._rounds - counts["rounds"]))
            for query in queries:
                self._round(query, previous)
                previous = query
            asking = [query.samples for query in queries]
            counts["rounds"] += len(queries)
            counts["samples"] += SAMPLES_A_ROUND * sum(asking)
        counts["unfinished"] = self._count_unfinished()
        return counts

    def _round(self, query: OcclusionQuery, previous: OcclusionQuery | None) -> None:
        """Four samples for each ray that still goes; balls are only drawn where there is one, which `query` learns."""
        passes, targets = self._passes, self._targets
        march = targets.marches[passes.now]
        passes.measure("cells_from_march", march_tx=march, depth_tx=targets.shared.depth)
        targets.ahead.clear(_NOTHING_AHEAD, _NOTHING_AHEAD, _NOTHING_AHEAD, 0.0)
        with nullcontext() if previous is None else previous.required():
            passes.blend(moderngl.MIN, moderngl.FUNC_ADD)
            passes.over_balls("next", targets.ahead, moderngl.BLEND | moderngl.DEPTH_TEST, march_tx=march)
        read = {"march_tx": march, "bracket_tx": passes.bracket}
        passes.over_screen("place", targets.shared.ask, next_tx=targets.next, **read)
        passes.count(query)
        with query.required():
            passes.sum_density()
        passes.over_screen("advance", targets.advance[1 - passes.now], **read)
        passes.turn()

    def _count_unfinished(self) -> int:
        query = self._queries.take(1)[0]
        self._passes.count(query, "unfinished", march_tx=self._targets.marches[self._passes.now])
        return query.samples
