"""Gives bpy such that its particle simulations are the same at every run: ``from .one_thread import bpy``.

Blender's classical SPH solver reads neighbours that other threads are moving. The differences are tiny, but a splash makes
them great. Blender takes as many threads as the process has processors when it loads, so it is loaded with one; the rest of
the process has all. In the Blender program start it with ``--threads 1`` for the same effect. Where the system cannot bind
processes to processors (macOS, Windows), or where bpy is loaded already, runs differ in detail.
"""

from __future__ import annotations

import os
import sys

# Loaded before, because it counts the processors as well.
import numpy  # noqa: F401

__all__ = ["bpy"]

if "bpy" in sys.modules or not hasattr(os, "sched_setaffinity"):
    import bpy
else:
    _processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(_processors)})
    try:
        import bpy
    finally:
        os.sched_setaffinity(0, _processors)
