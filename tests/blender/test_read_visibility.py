"""What is hidden supplies no balls, in renders and in the viewport each by its own switches."""

import importlib

import bpy
import pytest
from fluid_scenes import add_object, add_points, input_error, instance_collection, read_balls


def counts(meniscus):
    """Balls in a render and in the viewport."""
    return len(read_balls(meniscus)), len(read_balls(meniscus, viewport=True))


@pytest.fixture
def collection(empty_scene):
    made = bpy.data.collections.new("Fluid")
    empty_scene.collection.children.link(made)
    return made


def layer_collection():
    return bpy.context.view_layer.layer_collection.children["Fluid"]


def test_only_objects_used_as_fluid_are_read(meniscus, collection):
    add_points(collection)
    add_points(collection, "Obstacle").meniscus.use_fluid = False
    assert counts(meniscus) == (4, 4)


def test_scene_without_source_is_an_error(meniscus, collection):
    add_points(collection).meniscus.use_fluid = False
    with pytest.raises(input_error(meniscus), match="No object supplies balls"):
        read_balls(meniscus)


def test_object_disabled_in_renders_is_in_the_viewport_only(meniscus, collection):
    add_points(collection).hide_render = True
    assert counts(meniscus) == (0, 4)


def test_collection_disabled_in_renders_is_in_the_viewport_only(meniscus, collection):
    inner = bpy.data.collections.new("Inner")
    collection.children.link(inner)
    add_points(inner)
    collection.hide_render = True
    assert counts(meniscus) == (0, 4)


def test_object_that_another_collection_renders_is_rendered(meniscus, collection, empty_scene):
    item = add_points(collection)
    collection.hide_render = True
    empty_scene.collection.objects.link(item)
    assert counts(meniscus) == (4, 4)


def test_excluded_collection_is_nowhere(meniscus, collection):
    add_points(collection)
    layer_collection().exclude = True
    assert counts(meniscus) == (0, 0)


def hide_object(item):
    item.hide_viewport = True


def hide_object_locally(item):
    item.hide_set(True)


def hide_collection(item):
    item.users_collection[0].hide_viewport = True


@pytest.mark.parametrize("hide", [hide_object, hide_object_locally, hide_collection])
def test_what_is_hidden_in_the_viewport_only_is_an_error_in_renders(meniscus, collection, hide):
    item = add_points(collection)
    hide(item)
    assert len(read_balls(meniscus, viewport=True)) == 0
    with pytest.raises(input_error(meniscus), match="'Points' is hidden in the viewport only"):
        read_balls(meniscus)
    item.hide_render = True
    assert counts(meniscus) == (0, 0)


def test_collection_that_the_viewport_hides_locally_is_rendered(meniscus, collection):
    add_points(collection)
    layer_collection().hide_viewport = True
    assert counts(meniscus) == (4, 0)


def test_instances_follow_the_visibility_of_their_instancer(meniscus, collection, empty_scene):
    source = bpy.data.collections.new("Source")
    item = add_points(source)
    instancer = instance_collection(empty_scene, source)
    assert counts(meniscus) == (4, 4)
    instancer.hide_render = True
    assert counts(meniscus) == (0, 4)
    instancer.hide_render, item.hide_render = False, True
    assert counts(meniscus) == (0, 4)


def test_render_reads_what_is_hidden_in_the_viewport_and_animated_settings(meniscus, collection, tmp_path):
    """With a render's own dependency graph, which is how a render engine reads."""
    hidden = add_points(collection, "Hidden")
    hidden.hide_viewport = True
    for frame, factor in ((1, 1.0), (5, 3.0)):
        hidden.meniscus.radius_factor = factor
        hidden.keyframe_insert("meniscus.radius_factor", frame=frame)
    add_points(collection, "Viewport only").hide_render = True
    camera = add_object(collection, "Camera", bpy.data.cameras.new("Camera"))
    scene = bpy.context.scene
    scene.camera = camera
    read_scene = importlib.import_module(meniscus.__name__ + ".addon.blender.read_scene")
    found = []

    class ReadingEngine(bpy.types.RenderEngine):
        bl_idname = "READING"
        bl_label = "Reading"

        def render(self, depsgraph):
            found.extend(read_scene.read_fluid(depsgraph).balls.radii.tolist())

    bpy.utils.register_class(ReadingEngine)
    try:
        scene.render.engine = "READING"
        scene.frame_start = scene.frame_end = 5
        scene.render.resolution_x = scene.render.resolution_y = 8
        scene.render.filepath = str(tmp_path / "####")
        bpy.ops.render.render(animation=True)
    finally:
        bpy.utils.unregister_class(ReadingEngine)
    assert found == [1.5] * 4
