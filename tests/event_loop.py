"""Lets Blender's event loop run in the middle of a test, which then goes on where it was.

All of pytest runs in a greenlet on Blender's main thread. A timer of Blender resumes it; `turns` goes back to Blender, which
handles events, runs timers and draws, and resumes it in the next turn.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable

import bpy
import greenlet

DEADLINE = 20.0
"""Seconds that a test waits for anything, at most."""


def start(work: Callable[[], None]) -> None:
    """Do `work`, which may call `turns`, once Blender's event loop runs. An exception in it ends Blender with exit status 1."""
    worker = greenlet.greenlet(work)

    def resume() -> float | None:
        try:
            worker.switch()
        except BaseException:  # noqa: BLE001 - Blender would print it, and wait for ever
            traceback.print_exc()
            leave(1)
        return None if worker.dead else 0.0

    bpy.app.timers.register(resume, persistent=True)


def leave(status: int) -> None:
    """End the process at once: Blender's own way to quit always has the exit status 0."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def turns(count: int = 1) -> None:
    """Let Blender go through its event loop `count` times; each time it draws what has been tagged for it."""
    for _ in range(count):
        greenlet.getcurrent().parent.switch()


def wait_until(condition: Callable[[], bool], what: str, seconds: float = DEADLINE) -> None:
    """Let the event loop run until the condition holds; AssertionError, which says for what, after `seconds`."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"waited {seconds} s in vain for {what}"
        turns()
