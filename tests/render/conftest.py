"""Fixtures of the render tests."""

from __future__ import annotations

from dataclasses import replace

import pytest
from silence import check_silence


@pytest.fixture(scope="session", autouse=True)
def opengl():
    """The render tests need OpenGL; a machine without it must say so, not pass."""
    from meniscus.gpu_shaders.context import shared_context

    return shared_context()


@pytest.fixture(autouse=True)
def silent_driver(opengl):
    """After each test: the driver must have nothing to say against the use of OpenGL."""
    yield
    check_silence(opengl)


@pytest.fixture
def pretend_limits(monkeypatch, opengl):
    """Lets the context claim smaller limits, by their names: ``pretend_limits(draw_buffers=4)``."""
    return lambda **limits: monkeypatch.setattr(opengl, "limits", replace(opengl.limits, **limits))


@pytest.fixture
def another_context(monkeypatch):
    """A context that a test may ruin, in the place of the process's own."""
    from meniscus.gpu_shaders import context

    monkeypatch.setattr(context, "_shared", None)
    first = context.shared_context()
    yield first
    for opened in {first, context._shared}:
        opened.close()
        check_silence(opened)
