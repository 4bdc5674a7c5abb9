"""How long a frame may take, and what passes cost: when the walk has to end so that the picture comes in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Clock = Callable[[], float]

FIRST_GUESS = 4.0
"""What follows the walk takes so many times as long as its first pass, before that was ever measured."""


@dataclass
class Experience:
    """What is known from frames before.

    Attributes
    ----------
    ending
        How many times as long as the first pass all that follows the walk takes: refining, gathering, writing, reading back.
    """

    ending: float = FIRST_GUESS

    def note(self, ending: float) -> None:
        """A frame has shown how long it takes: longer ones count at once, shorter ones slowly."""
        self.ending = max(ending, 0.75 * self.ending + 0.25 * ending)


class Budget:
    """The time of one frame.

    Parameters
    ----------
    clock
        Seconds, from anywhere.
    seconds
        How long the frame may take from now on; None for no end.
    pixels
        How many it has.
    experience
        From frames before, and for those to come.
    """

    def __init__(self, clock: Clock, seconds: float | None, pixels: int, experience: Experience) -> None:
        self._clock = clock
        self._end = None if seconds is None else clock() + seconds
        self._pixels = pixels
        self._experience = experience
        self._part_end = 0.0
        self._noted_at = 0.0
        self._first_pass: float | None = None
        self._pass_seconds = 0.0

    @property
    def is_limited(self) -> bool:
        """Whether there is an end at all."""
        return self._end is not None

    @property
    def knows_passes(self) -> bool:
        """Whether what a pass takes is known, or does not matter."""
        return self._end is None or self._first_pass is not None

    def begin_part(self, pixels: int) -> None:
        """A part of the image begins to walk: it may use the share of its pixels in the time that is left."""
        self._noted_at = now = self._clock()
        self._first_pass, self._pass_seconds = None, 0.0
        if self._end is not None:
            self._part_end = now + max(self._end - now, 0.0) * pixels / max(self._pixels, 1)
        self._pixels -= pixels

    def note_pass(self) -> None:
        """One more pass is done."""
        now = self._clock()
        self._pass_seconds, self._noted_at = now - self._noted_at, now
        if self._first_pass is None:
            self._first_pass = self._pass_seconds

    def allows_pass(self, under_way: int) -> bool:
        """Whether another pass would be done in time, after those that are under way, and all that follows too."""
        if self._end is None or self._first_pass is None:
            return True
        needed = (under_way + 1) * self._pass_seconds + self._experience.ending * self._first_pass
        return self._clock() + needed <= self._part_end

    def note_end(self) -> None:
        """All that follows the last noted pass is done."""
        if self._first_pass:
            self._experience.note((self._clock() - self._noted_at) / self._first_pass)
