"""Mesh vertices and point clouds become balls."""

import bpy
import numpy as np
import pytest
from fluid_scenes import (
    GRID_POINTS,
    add_emitter,
    add_geometry_nodes,
    add_object,
    add_points,
    assert_same_points,
    input_error,
    instance_collection,
    play,
    read_balls,
    store,
)
from mathutils import Matrix

MOVE = Matrix.LocRotScale((1.0, -2.0, 3.0), Matrix.Rotation(0.7, 3, "X"), (1.0, 2.0, 4.0))


def moved(points, transform=MOVE):
    transform = np.array(transform)
    return points @ transform[:3, :3].T + transform[:3, 3]


def test_positions_and_radii_follow_the_objects_transform(meniscus, empty_scene):
    add_points(empty_scene.collection).matrix_world = MOVE
    balls = read_balls(meniscus)
    np.testing.assert_allclose(balls.positions, moved(GRID_POINTS), atol=1e-5)
    np.testing.assert_allclose(balls.radii, np.full(4, 0.5 * 2.0), rtol=1e-5)
    assert balls.velocities is None
    assert balls.colors is None
    assert balls.ids is None
    np.testing.assert_array_equal(balls.weights, np.ones(4))


def test_velocities_turn_and_scale_with_the_object_but_do_not_move(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    velocities = np.arange(12, dtype=np.float32).reshape(4, 3)
    store(item.data, "velocity", "FLOAT_VECTOR", "vector", velocities)
    item.matrix_world = MOVE
    np.testing.assert_allclose(read_balls(meniscus).velocities, velocities @ np.array(MOVE)[:3, :3].T, rtol=1e-5, atol=1e-5)


def test_ids_are_read(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    store(item.data, "id", "INT", "value", np.array([7, 2**30, 0, -4], np.int32))
    np.testing.assert_array_equal(read_balls(meniscus).ids, [7, 2**30, 0, -4])


@pytest.mark.parametrize("data_type", ["FLOAT_COLOR", "BYTE_COLOR", "FLOAT_VECTOR"])
def test_colours_are_read_from_an_attribute(meniscus, empty_scene, data_type):
    item = add_points(empty_scene.collection)
    colors = np.array([(0, 0, 0, 1), (1, 1, 1, 1), (0.5, 0.2, 0.1, 1), (0.8, 0.3, 0.6, 1)], np.float32)
    if data_type == "FLOAT_VECTOR":
        store(item.data, "Paint", data_type, "vector", colors[:, :3])
    else:
        store(item.data, "Paint", data_type, "color", colors)
    item.meniscus.color_mode, item.meniscus.color_attribute = "ATTRIBUTE", "Paint"
    # Bytes hold sRGB, whose steps are at most 0.01 apart in linear light.
    tolerance = 0.01 if data_type == "BYTE_COLOR" else 1e-6
    np.testing.assert_allclose(read_balls(meniscus).colors, colors[:, :3], atol=tolerance)


@pytest.mark.parametrize(("data_type", "values"), [("FLOAT", [0.5, 1.0, 1.5, 2.0]), ("INT", [1, 2, 3, 4])])
def test_radius_is_read_from_an_attribute_without_the_factor(meniscus, empty_scene, data_type, values):
    item = add_points(empty_scene.collection)
    store(item.data, "reach", data_type, "value", values)
    settings = item.meniscus
    settings.radius_mode, settings.radius_attribute, settings.radius_factor = "ATTRIBUTE", "reach", 5.0
    np.testing.assert_array_equal(read_balls(meniscus).radii, values)


def test_fixed_radius_needs_no_attribute_and_scales_with_the_object(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    item.data.attributes.remove(item.data.attributes["radius"])
    item.meniscus.radius_mode, item.meniscus.radius = "FIXED", 0.25
    item.scale = (3.0, 3.0, 3.0)
    np.testing.assert_allclose(read_balls(meniscus).radii, np.full(4, 0.75), rtol=1e-6)


def test_missing_radius_is_an_error_that_names_object_and_attribute(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    item.meniscus.radius_mode, item.meniscus.radius_attribute = "ATTRIBUTE", "reach"
    with pytest.raises(input_error(meniscus), match="points of 'Points' have no attribute 'reach'"):
        read_balls(meniscus)


def test_attribute_of_the_wrong_type_is_an_error_that_says_so(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    item.meniscus.radius_mode, item.meniscus.radius_attribute = "ATTRIBUTE", "position"
    with pytest.raises(input_error(meniscus), match="'position' of the type FLOAT_VECTOR, which is no number"):
        read_balls(meniscus)


def test_attribute_on_the_wrong_domain_is_an_error_that_says_so(meniscus, empty_scene):
    mesh = bpy.data.meshes.new("Face")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    store(mesh, "radius", "FLOAT", "value", [1.0], domain="FACE")
    add_object(empty_scene.collection, "Face", mesh).meniscus.use_fluid = True
    with pytest.raises(input_error(meniscus), match="it is on the domain FACE"):
        read_balls(meniscus)


def test_unusable_points_are_dropped_and_counted(meniscus, empty_scene):
    points = np.concatenate((GRID_POINTS, [(np.nan, 0, 0), (0, np.inf, 0)]))
    item = add_points(empty_scene.collection, points=points)
    item.data.attributes["radius"].data[0].value = -1.0
    balls = read_balls(meniscus)
    assert len(balls) == 3
    assert balls.dropped == {"position is not finite": 2, "radius is not greater than zero": 1}


def test_points_that_geometry_nodes_make_are_read(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    _, (to_points,) = add_geometry_nodes(item, "GeometryNodeMeshToPoints")
    to_points.inputs["Radius"].default_value = 0.2
    item.matrix_world = MOVE
    balls = read_balls(meniscus)
    assert_same_points(balls.positions, moved(GRID_POINTS))
    np.testing.assert_allclose(balls.radii, np.full(4, 0.4), rtol=1e-5)


def test_points_that_geometry_nodes_instance_are_read_at_each_place(meniscus, empty_scene):
    item = add_points(empty_scene.collection, points=GRID_POINTS[:2])
    group, (to_points, on_points) = add_geometry_nodes(item, "GeometryNodeMeshToPoints", "GeometryNodeInstanceOnPoints")
    to_points.inputs["Radius"].default_value = 0.2
    entry = next(node for node in group.nodes if node.type == "GROUP_INPUT")
    group.links.new(entry.outputs[0], on_points.inputs["Points"])
    group.links.new(to_points.outputs[0], on_points.inputs["Instance"])
    on_points.inputs["Scale"].default_value = (3.0, 3.0, 3.0)
    item.location.y = 1.0
    balls = read_balls(meniscus)
    assert_same_points(balls.positions, [(0, 1, 0), (3, 1, 0), (1, 1, 0), (4, 1, 0)])
    np.testing.assert_allclose(balls.radii, np.full(4, 0.6), rtol=1e-5)


def test_collection_instances_are_read_at_each_place(meniscus, empty_scene):
    collection = bpy.data.collections.new("Fluid")
    add_points(collection).location.x = 1.0
    for height in (5.0, 9.0):
        instance_collection(empty_scene, collection, f"At {height}", location=(0.0, 0.0, height))
    expected = np.concatenate([GRID_POINTS + (1, 0, height) for height in (5, 9)])
    assert_same_points(read_balls(meniscus).positions, expected)


def test_points_drawn_by_particles_are_read_at_each_particle(meniscus, empty_scene):
    emitter = add_emitter(empty_scene.collection, count=5)
    emitter.meniscus.use_fluid = False
    drawn = add_points(empty_scene.collection)
    drawn.hide_render = drawn.hide_viewport = False
    settings = emitter.particle_systems[0].settings
    settings.render_type, settings.instance_object = "OBJECT", drawn
    play(empty_scene, 2)
    assert len(read_balls(meniscus)) == 4 * (5 + 1)


def test_sources_are_joined_and_what_some_lack_is_filled(meniscus, empty_scene):
    plain = add_points(empty_scene.collection, "Plain", points=GRID_POINTS[:1])
    painted = add_points(empty_scene.collection, "Painted", points=GRID_POINTS[1:])
    store(painted.data, "velocity", "FLOAT_VECTOR", "vector", np.ones((3, 3), np.float32))
    painted.meniscus.color_mode, painted.meniscus.color = "FIXED", (1.0, 0.0, 0.0)
    plain.meniscus.weight = 2.0
    empty_scene.meniscus.color = (0.0, 1.0, 0.0)
    balls = read_balls(meniscus)
    is_plain = np.all(balls.positions == 0, axis=1)
    assert np.count_nonzero(is_plain) == 1
    np.testing.assert_array_equal(balls.weights, np.where(is_plain, 2, 1))
    np.testing.assert_array_equal(balls.colors, np.where(is_plain[:, None], (0, 1, 0), (1, 0, 0)))
    np.testing.assert_array_equal(balls.velocities, np.where(is_plain[:, None], 0, np.ones(3)))


def test_points_of_an_emitter_are_read_where_points_are_asked_for(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    item.meniscus.source, item.meniscus.radius_mode = "POINTS", "FIXED"
    play(empty_scene, 2)
    assert len(read_balls(meniscus)) == 4


def test_mesh_in_edit_mode_is_read(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.mode_set(mode="EDIT")
    balls = read_balls(meniscus)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_points(balls.positions, GRID_POINTS)


def test_animated_settings_are_read_at_the_current_frame(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    for frame, factor in ((1, 1.0), (5, 3.0)):
        item.meniscus.radius_factor = factor
        item.keyframe_insert("meniscus.radius_factor", frame=frame)
    for frame, radius in ((1, 0.5), (5, 1.5)):
        empty_scene.frame_set(frame)
        np.testing.assert_allclose(read_balls(meniscus).radii, np.full(4, radius), rtol=1e-5)


def test_empty_mesh_gives_no_balls_and_no_error(meniscus, empty_scene):
    add_object(empty_scene.collection, "Empty mesh", bpy.data.meshes.new("Empty mesh")).meniscus.use_fluid = True
    assert len(read_balls(meniscus)) == 0


def test_object_that_cannot_have_points_is_an_error_that_names_it(meniscus, empty_scene):
    add_object(empty_scene.collection, "Nothing", None).meniscus.use_fluid = True
    with pytest.raises(input_error(meniscus), match="'Nothing' has neither particles nor points"):
        read_balls(meniscus)
