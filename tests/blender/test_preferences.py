"""The user's settings count where a scene leaves the choice."""

import importlib

import bpy
import pytest


@pytest.fixture
def preferences(meniscus, empty_scene):
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.preferences")


def test_there_are_preferences(preferences):
    chosen = preferences.preferences()
    assert (chosen.backend, chosen.threads, chosen.memory_limit) == ("auto", 0, 512)


def test_the_scene_comes_before_the_user(preferences):
    chosen, settings = preferences.preferences(), bpy.context.scene.meniscus
    chosen.backend = "cpu"
    try:
        assert preferences.backend_of(bpy.context.scene) == "cpu"
        settings.backend = "gpu"
        assert preferences.backend_of(bpy.context.scene) == "gpu"
    finally:
        chosen.backend = "auto"
