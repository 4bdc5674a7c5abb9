"""Viewports read the balls again when something has changed that they depend on, and only then."""

import importlib

import bpy
import numpy as np
import pytest
from fluid_scenes import add_emitter, add_object, add_points, instance_collection, play


@pytest.fixture
def module(meniscus):
    """A module of addon.blender by its name."""
    return lambda name: importlib.import_module(f"{meniscus.__name__}.addon.blender.{name}")


@pytest.fixture
def space(empty_scene):
    """A 3D viewport that shows what the view layer does."""
    areas = (area for screen in bpy.data.screens for area in screen.areas)
    return next(area for area in areas if area.type == "VIEW_3D").spaces.active


@pytest.fixture
def reader(module, space):
    """Reads the present scene; `reader.reads` counts."""
    scene_balls = module("scene_balls").SceneBalls(module("changes").CHANGES)
    module("changes").CHANGES.note()

    class Reader:
        def __call__(self):
            bpy.context.view_layer.update()
            fluid = scene_balls.fluid(bpy.context.view_layer.depsgraph, space)
            return fluid and fluid.balls

        @property
        def reads(self):
            return scene_balls.reads

    return Reader()


@pytest.fixture
def fluid(empty_scene):
    return add_points(empty_scene.collection)


def test_what_has_not_changed_is_not_read_again(reader, fluid):
    balls = reader()
    assert len(balls) == 4
    assert reader() is balls
    assert reader.reads == 1


@pytest.mark.parametrize(
    ("change", "positions_change"),
    [
        (lambda item: setattr(item, "location", (0, 0, 5)), True),
        (lambda item: item.data.vertices[0].co.__setitem__(0, 7.0) or item.data.update(), True),
        (lambda item: setattr(item.meniscus, "radius_factor", 2.0), True),
        (lambda item: setattr(item.meniscus, "weight", 0.5), True),
        (lambda item: setattr(item, "hide_viewport", True), True),
        (lambda item: item.hide_set(True), True),
        (lambda item: setattr(item.modifiers.new("Array", "ARRAY"), "count", 3), True),
    ],
    ids=["moved", "edited", "radius", "weight", "disabled", "hidden", "modifier"],
)
def test_a_change_of_the_fluid_is_seen(reader, fluid, change, positions_change):
    before = reader()
    change(fluid)
    after = reader()
    assert (after is not before) == positions_change


@pytest.mark.parametrize("make", ["camera", "light"])
def test_cameras_and_lights_may_move(reader, fluid, empty_scene, make):
    data = bpy.data.cameras.new("Camera") if make == "camera" else bpy.data.lights.new("Light", "POINT")
    item = add_object(empty_scene.collection, "Item", data)
    balls = reader()
    reads = reader.reads
    item.location = (1, 2, 3)
    assert reader() is balls
    assert reader.reads == reads


def test_other_objects_may_move_without_new_images(reader, fluid, empty_scene):
    other = add_points(empty_scene.collection, "Other")
    other.meniscus.use_fluid = False
    balls = reader()
    other.location = (1, 2, 3)
    assert reader() is balls, "the same balls are the same object, so that nothing is rendered anew"


def test_each_frame_of_particles_is_read(reader, empty_scene):
    add_emitter(empty_scene.collection)
    play(empty_scene, 3)
    heights = []
    for frame in (4, 5, 6):
        empty_scene.frame_set(frame)
        heights.append(reader().positions[:, 2].mean())
    assert np.all(np.diff(heights) > 0.01)
    reads = reader.reads
    empty_scene.frame_set(6)
    reader()
    assert reader.reads == reads + 1


def test_subframes_are_read(reader, empty_scene):
    item = add_points(empty_scene.collection)
    item.keyframe_insert("location", frame=1)
    item.location = (0, 0, 10)
    item.keyframe_insert("location", frame=2)
    for curve in curves_of(item):
        curve.keyframe_points[0].interpolation = "LINEAR"
    empty_scene.frame_set(1, subframe=0.25)
    assert reader().positions[0, 2] == pytest.approx(2.5, abs=1e-4)


def curves_of(item):
    action = item.animation_data.action
    if hasattr(action, "fcurves"):
        return action.fcurves
    return action.layers[0].strips[0].channelbags[0].fcurves


def test_an_emitter_that_starts_from_nothing(reader, empty_scene):
    add_emitter(empty_scene.collection, frame_start=3, frame_end=3)
    empty_scene.frame_set(1)
    assert len(reader()) == 0
    play(empty_scene, 4)
    assert len(reader()) == 50


def test_without_sources_nothing_is_read_again_and_again(reader, empty_scene, module):
    item = add_points(empty_scene.collection)
    item.meniscus.use_fluid = False
    assert reader() is None
    assert not module("changes").CHANGES.may_have_sources
    reads = reader.reads
    empty_scene.frame_set(5)
    item.location = (1, 1, 1)
    assert reader() is None
    assert reader.reads == reads
    item.meniscus.use_fluid = True
    assert len(reader()) == 4


def test_a_source_that_is_appended_or_copied_is_found(reader, empty_scene):
    assert reader() is None
    item = add_points(empty_scene.collection)
    item.meniscus.use_fluid = False
    reader()
    item.meniscus["use_fluid"] = True  # as data that comes with a file, of which no update tells
    copy = item.copy()
    empty_scene.collection.objects.link(copy)
    if copy.meniscus.use_fluid:
        assert len(reader()) == 8


def test_a_deleted_source_is_gone(reader, fluid):
    assert len(reader()) == 4
    bpy.data.objects.remove(fluid)
    assert reader() is None


def test_a_moved_instance_is_seen(reader, empty_scene):
    collection = bpy.data.collections.new("Library")
    add_points(collection)
    empty = instance_collection(empty_scene, collection)
    first = reader()
    empty.location = (0, 0, 9)
    assert reader().positions[:, 2].mean() == pytest.approx(first.positions[:, 2].mean() + 9, abs=1e-4)


def test_local_view_has_its_own_balls(reader, module, fluid, space):
    whole = reader()
    other = module("scene_balls")._key(bpy.context.view_layer.depsgraph, space)
    space.use_local_collections = True
    assert module("scene_balls")._key(bpy.context.view_layer.depsgraph, space) != other
    space.use_local_collections = False
    assert reader() is whole
