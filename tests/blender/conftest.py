"""Fixtures of the tests inside Blender; pytest finds them here."""

from blender_fixtures import blender_output, empty_scene, meniscus, registered_package

__all__ = ["blender_output", "empty_scene", "meniscus", "registered_package"]
