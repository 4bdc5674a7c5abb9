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


def test_the_command_line_asks_its_arguments_then_the_scene_then_the_user(preferences, meniscus, tmp_path):
    package = f"{meniscus.__name__}.addon.blender"
    command_line = importlib.import_module(f"{package}.command_line")
    arguments = ["render", "--frames", "1", "--output", str(tmp_path / "fluid.exr")]
    scene, chosen = bpy.context.scene, preferences.preferences()

    def job(*more):
        return command_line._job(command_line.parse_arguments([*arguments, *more]))

    chosen.backend, chosen.threads = "cpu", 3
    try:
        assert (job().settings.choice.backend, job("--backend", "gpu").settings.choice.backend) == ("cpu", "gpu")
        assert preferences.threads_of(scene) == 3
        scene.render.threads_mode, scene.render.threads = "FIXED", 2
        assert preferences.threads_of(scene) == 2
        scene.meniscus.backend = "gpu"
        assert job().settings.choice.backend == "gpu"
    finally:
        chosen.backend, chosen.threads = "auto", 0
