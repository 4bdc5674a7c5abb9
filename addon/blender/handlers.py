"""Blender's handlers: what is called when something happens in a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import bpy

Handlers = Mapping[str, Callable[..., Any]]
"""By the name of the list in :mod:`bpy.app.handlers`; those that a Blender does not have are passed over."""


def add_handlers(handlers: Handlers) -> None:
    """Have Blender call them from now on."""
    for calls, handler in _lists(handlers):
        calls.append(handler)


def remove_handlers(handlers: Handlers) -> None:
    """Have Blender call them no more."""
    for calls, handler in _lists(handlers):
        calls.remove(handler)


def _lists(handlers: Handlers) -> list[tuple[list[Any], Callable[..., Any]]]:
    there = ((getattr(bpy.app.handlers, name, None), handler) for name, handler in handlers.items())
    return [(calls, handler) for calls, handler in there if calls is not None]
