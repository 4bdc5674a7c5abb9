"""What is shown otherwise than the scene says, because it cannot be read: sentences for whoever looks at the picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_NOTES: ContextVar[dict[str, None] | None] = ContextVar("meniscus_notes", default=None)


@contextmanager
def collected_notes() -> Iterator[dict[str, None]]:
    """Collects what is noted by this thread within, each sentence once and in order, as the keys of a dictionary."""
    notes: dict[str, None] = {}
    token = _NOTES.set(notes)
    try:
        yield notes
    finally:
        _NOTES.reset(token)


def note(sentence: str) -> None:
    """Say what is shown otherwise, to whoever collects that."""
    notes = _NOTES.get()
    if notes is not None:
        notes[sentence] = None
