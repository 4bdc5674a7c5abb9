"""Fixtures of the tests in a window; pytest finds them here."""

from blender_fixtures import blender_output, meniscus, registered_package

__all__ = ["blender_output", "meniscus", "registered_package"]
