"""When an image is, in which sequence: what methods take from one image to the next hangs on it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TypeVar, cast

Kept = TypeVar("Kept")


class Sequence:
    """Images of one fluid that follow one another in time, used by one thread at a time.

    What methods keep from one image to the next lives as long as the sequence.
    """

    def __init__(self) -> None:
        self._kept: dict[str, tuple[Hashable, object]] = {}

    def kept(self, name: str, key: Hashable, make: Callable[[], Kept]) -> Kept:
        """What was made under this name last, if that was for the same key; else it is made anew."""
        known_key, kept = self._kept.get(name, (None, None))
        if kept is None or known_key != key:
            kept = make()
            self._kept[name] = key, kept
        return cast(Kept, kept)


@dataclass(frozen=True)
class Instant:
    """When an image is.

    Attributes
    ----------
    seconds
        By the clock of the scene; None for an image that stands for itself.
    sequence
        What it belongs to.
    """

    seconds: float | None = None
    sequence: Sequence = field(default_factory=Sequence)
