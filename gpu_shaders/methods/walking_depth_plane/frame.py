"""One image on its way through the shaders of Walking Depth Plane."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import moderngl

from ...context import GpuContext
from ...image_cells import plain
from ...occlusion import OcclusionQueries, OcclusionQuery
from ...sampling.passes import SamplingPasses
from ...sampling.targets import SamplingTargets
from .budget import Budget

UNDER_WAY = 1
"""Passes that the graphics processor has still to do when the processor asks what an older one has left."""
_NOTHING = 1e30
"""As in walk.glsl."""


class WalkTargets:
    """What this method draws into beside the shared targets.

    Attributes
    ----------
    places, paces
        Two each, see walk.glsl: `begin` draws into one, and into the samples; `advance` draws into one, and into the bracket of
        the same number, while the others are read.
    far
        Beside the sums, see ahead.frag; `ahead` draws into both.
    """

    def __init__(self, context: GpuContext, shared: SamplingTargets) -> None:
        gl = context.gl
        self.shared = shared
        self.places = [plain(gl.texture(shared.size, 4, dtype="f4")) for _ in range(2)]
        self.paces = [plain(gl.texture(shared.size, 2, dtype="f4")) for _ in range(2)]
        self.far = plain(gl.texture(shared.size, 4, dtype="f4"))
        triples = zip(self.places, self.paces, shared.brackets, strict=True)
        self.advance = [gl.framebuffer(list(triple)) for triple in triples]
        pairs = zip(self.places, self.paces, strict=True)
        self.begin = [gl.framebuffer([shared.samples, *pair], shared.depth) for pair in pairs]
        self.ahead = gl.framebuffer([shared.sums[0], self.far], shared.depth)
        self.ahead.depth_mask = False


@dataclass(frozen=True)
class Ending:
    """When the walk ends, but for the time.

    Attributes
    ----------
    most_passes
        After so many passes.
    finished
        When this share of the rays has arrived.
    """

    most_passes: int
    finished: float


class Frame:
    """Walks the rays of one image to the surface; on the context's thread.

    Parameters
    ----------
    passes, targets
        Where to draw.
    queries
        For the occlusion queries.
    check_cancelled
        Called before each pass; may raise.
    """

    def __init__(
        self, passes: SamplingPasses, targets: WalkTargets, queries: OcclusionQueries, check_cancelled: Callable[[], None]
    ) -> None:
        self._passes, self._targets = passes, targets
        self._check_cancelled = check_cancelled
        self._at_start, self._at_end, *self._after_pass = queries.take(2 + UNDER_WAY + 1)

    def walk(self, ending: Ending, budget: Budget) -> dict[str, int]:
        """Walk until an end is reached; counts of what happened."""
        self._enter()
        if budget.is_limited:
            # This waits: what was asked for before is not what a pass costs.
            _ = self._at_start.samples
        budget.begin_part(self._targets.shared.size[0] * self._targets.shared.size[1])
        passes = self._walk(ending, budget)
        self._count_walking(self._at_end)
        chance, unfinished = self._at_start.samples, self._at_end.samples
        return {"passes": passes, "rays": chance, "finished": chance - unfinished, "unfinished": unfinished}

    def _walk(self, ending: Ending, budget: Budget) -> int:
        """How many passes it took. Where time counts the first one is waited for, to know what the next will take."""
        under_way: deque[OcclusionQuery] = deque()
        for number in range(ending.most_passes):
            self._check_cancelled()
            query = self._after_pass[number % len(self._after_pass)]
            self._one_pass(query)
            under_way.append(query)
            if len(under_way) > (UNDER_WAY if budget.knows_passes else 0):
                left = under_way.popleft().samples
                budget.note_pass()
                if left <= (1.0 - ending.finished) * self._at_start.samples:
                    return number + 1
            if not budget.allows_pass(len(under_way)):
                return number + 1
        return ending.most_passes

    def _enter(self) -> None:
        """Find out where the rays start, and what is ahead."""
        passes, targets = self._passes, self._targets
        passes.over_screen("begin_walk", targets.begin[1 - passes.now])
        self._look_ahead(1 - passes.now)
        passes.over_screen("start", targets.shared.start)
        read = {"near_tx": passes.sums, "far_tx": targets.far}
        passes.over_screen("enter", targets.advance[passes.now], **read)
        self._count_walking(self._at_start)
        self._ask()

    def _one_pass(self, query: OcclusionQuery) -> None:
        """Sum densities, move the plane, and ask how many pixels go on."""
        passes, targets = self._passes, self._targets
        self._look_ahead(passes.now)
        read = {"near_tx": passes.sums, "far_tx": targets.far, **self._state()}
        passes.over_screen("advance", targets.advance[1 - passes.now], **read)
        passes.turn()
        self._ask()
        passes.count(query)

    def _look_ahead(self, now: int) -> None:
        passes, ahead, places = self._passes, self._targets.ahead, self._targets.places[now]
        passes.measure("cells_from_walks", place_tx=places, pace_tx=self._targets.paces[now])
        ahead.clear(0.0, 0.0, 0.0, _NOTHING)
        passes.blend(moderngl.FUNC_ADD, moderngl.MIN)
        passes.over_balls("ahead", ahead, moderngl.BLEND | moderngl.DEPTH_TEST, place_tx=places)

    def _ask(self) -> None:
        self._passes.over_screen("ask", self._targets.shared.ask, **self._state())

    def _count_walking(self, query: OcclusionQuery) -> None:
        self._passes.count(query, "walking", place_tx=self._targets.places[self._passes.now])

    def _state(self) -> dict[str, moderngl.Texture]:
        now = self._passes.now
        return {
            "place_tx": self._targets.places[now],
            "pace_tx": self._targets.paces[now],
            "bracket_tx": self._passes.bracket,
        }
