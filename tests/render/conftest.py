"""Fixtures of the render tests."""

from __future__ import annotations

import pytest

import meniscus


@pytest.fixture(scope="session", autouse=True)
def opengl():
    """The render tests need OpenGL; a machine without it must say so, not pass."""
    from meniscus.gpu_shaders.context import shared_context

    return shared_context()


@pytest.fixture
def depth_peeling_with_list_of(monkeypatch, opengl):
    """Renders with depth peeling whose lists hold only so many balls."""
    from meniscus.gpu_shaders.methods.depth_peeling import method

    def render(length, scene, camera):
        monkeypatch.setattr(method, "create", lambda: method.DepthPeeling(opengl, length))
        return meniscus.render(scene.balls, camera, scene.field, method="depth_peeling")

    return render
