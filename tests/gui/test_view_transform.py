"""The fluid goes through the same colour management as the meshes beside it."""

import bpy
import numpy as np
import pytest
from event_loop import wait_until
from expected import box, is_inner
from fluid_scenes import add_points
from fluid_views import FLUID_COLOR
from mathutils import Euler
from viewports import look

CUBE = box((0, 0, 0), 1.0)
COLOR = (0.1, 0.5, 0.8)
TOLERANCE = 3
"""By how much a byte may differ: EEVEE dithers, and keeps half floats."""


@pytest.fixture
def shown(new_file, fluid):
    """A viewport with fluid beside a cube that emits the fluid's colour, and settings of the view that all matter."""
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=[(2.2, 0, 0), (2.2, 0.3, 0)], radius=1.5)
    look(shown.view, Euler((1.0, 0.2, 0.5)).to_quaternion(), 12.0)
    bpy.data.objects["Cube"].data.materials[0] = emission(COLOR)
    bpy.context.scene.meniscus.color = COLOR
    bpy.context.scene.eevee.taa_samples = 1
    view = bpy.context.scene.view_settings
    view.view_transform = "AgX"
    view.look = next(item for item in look_names(view) if "High Contrast" in item)
    view.exposure, view.gamma = 0.7, 1.3
    return shown


def look_names(view):
    """The looks that the view transform has; Blender tells only in the message of an error."""
    try:
        view.look = "unknown"
    except TypeError as error:
        return [name for name in str(error).split("'") if len(name) > 2]


def emission(color):
    material = bpy.data.materials.new("Emission")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    source, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    source.inputs["Color"].default_value = (*color, 1)
    material.node_tree.links.new(source.outputs[0], output.inputs["Surface"])
    return material


def colors(fluid, shown):
    """(3,) of the fluid and of the cube."""
    picture = fluid.settled(shown)
    labels = fluid.labels(shown, [CUBE])
    inner = is_inner(labels)
    return [np.median(picture[inner & (labels == label)].astype(float), axis=0) for label in (0, 1)]


@pytest.mark.parametrize(("shading", "lights"), [("MATERIAL", False), ("MATERIAL", True), ("RENDERED", True)])
def test_fluid_and_emission_of_one_color_look_the_same(fluid, shown, shading, lights):
    shown.space.shading.type = shading
    shown.space.shading.use_scene_lights = lights
    fluid.wait_for_meshes(shown, [CUBE])
    settings = bpy.context.scene.view_settings
    for exposure in (0.7, -1.0):
        settings.exposure = exposure
        of_fluid, of_cube = colors(fluid, shown)
        np.testing.assert_allclose(of_fluid, of_cube, atol=TOLERANCE)


def test_curves_and_white_balance_count(fluid, shown):
    settings = bpy.context.scene.view_settings
    settings.use_curve_mapping = True
    settings.curve_mapping.curves[3].points.new(0.3, 0.6)
    settings.curve_mapping.update()
    if hasattr(settings, "use_white_balance"):
        settings.use_white_balance, settings.white_balance_temperature = True, 4000
    shown.space.shading.type = "RENDERED"
    fluid.wait_for_meshes(shown, [CUBE])
    of_fluid, of_cube = colors(fluid, shown)
    np.testing.assert_allclose(of_fluid, of_cube, atol=TOLERANCE)


def test_solid_shading_takes_nothing_from_the_scene(fluid, shown):
    bpy.context.scene.meniscus.color = FLUID_COLOR
    bpy.context.scene.view_settings.exposure = 3.0
    fluid.check_exactly("solid_colors", shown, [CUBE])


def test_tables_leave_nothing_behind(fluid, shown):
    scenes, images = len(bpy.data.scenes), len(bpy.data.images)
    shown.space.shading.type = "RENDERED"
    transforms = fluid.module("viewport")._drawing._transforms
    wait_until(lambda: len(transforms._tables) > 1 and not transforms.has_missing, "the table")
    assert (len(bpy.data.scenes), len(bpy.data.images)) == (scenes, images)
    assert transforms.problem == ""
