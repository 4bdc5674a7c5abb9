"""A user's hand: what the X server reports of a mouse and a keyboard."""

import shutil
import subprocess

import pytest
from event_loop import turns

needs_hand = pytest.mark.skipif(not shutil.which("xdotool"), reason="there is no xdotool to move the mouse with")
"""The Blender programs that the tests set up bring it along; one that a developer names may not."""


def act(*words):
    """Let the mouse or the keyboard do something, and Blender learn of it."""
    subprocess.run(["xdotool", *map(str, words)], check=True, timeout=10)
    turns(3)
