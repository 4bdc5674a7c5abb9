"""Motion: what is read of the frames before and after, and what it says."""

import importlib

import bpy
import numpy as np
import pytest
from fluid_scenes import GRID_POINTS, add_geometry_nodes, add_object, add_points, instance_collection, store

SECONDS = 0.5, 0.5
UP = np.array((0, 0, 1), np.float32)


@pytest.fixture
def module(meniscus):
    """Gives modules of the package by name."""
    return lambda name: importlib.import_module(f"{meniscus.__name__}.addon.blender.{name}")


@pytest.fixture
def scene(empty_scene):
    """A fluid of points without velocities before a camera, both still, at frame 5 of one second each."""
    add_points(empty_scene.collection)
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -9, 1), (np.pi / 2, 0, 0)
    empty_scene.camera = camera
    empty_scene.render.fps = 1
    empty_scene.frame_set(5)
    return empty_scene


@pytest.fixture
def read_all(module, scene):
    """Reads the scene for some passes; gives what was read, and the frames that were asked for."""
    render_scene = module("render_scene")

    def read_for(*passes, **settings):
        frames = []

        def set_frame(frame, subframe):
            frames.append(frame + subframe)
            scene.frame_set(frame, subframe=subframe)

        settings = render_scene.RenderSettings(passes, **settings)
        return render_scene.read_view_layer(bpy.context.evaluated_depsgraph_get(), settings, set_frame), frames

    return read_for


@pytest.fixture
def read(read_all):
    """The same; gives the velocities of the balls, the motion, and the frames."""

    def read_for(*passes):
        found, frames = read_all(*passes)
        return found.moment.fluid.balls.velocities, found.motion, frames

    return read_for


def animate(item, path, values):
    """Keyframes at the frames 4, 5, 6."""
    for frame, value in enumerate(values, 4):
        setattr(item, path, value)
        item.keyframe_insert(path, frame=frame)


def _curves(item):
    action = item.animation_data.action
    return action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves


def add_cube(scene):
    bpy.ops.mesh.primitive_cube_add()
    return bpy.context.object


def test_neighbours_are_read_for_passes_of_motion_only(scene, read):
    animate(scene.objects["Points"], "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    animate(add_cube(scene), "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    scene.frame_set(5)
    velocities, motion, frames = read("combined", "depth")
    assert (velocities, motion, frames) == (None, None, [])
    for name in ("velocity", "speed", "vector"):
        velocities, motion, frames = read(name)
        np.testing.assert_allclose(velocities, [2 * UP] * 4)
        assert frames == [4, 6, 5]
        assert (motion is not None) == (name == "vector")


def test_nothing_is_read_where_nothing_moves(scene, read):
    points = scene.objects["Points"]
    add_cube(scene)
    store(points.data, "velocity", "FLOAT_VECTOR", "vector", [UP] * 4)
    velocities, motion, frames = read("vector")
    np.testing.assert_array_equal(velocities, [UP] * 4)
    assert frames == []
    assert motion.previous_vertices is motion.following_vertices is None


def test_velocities_are_those_of_points_and_of_their_object(scene, read):
    points = scene.objects["Points"]
    store(points.data, "velocity", "FLOAT_VECTOR", "vector", [(1, 0, 0)] * 4)
    animate(points, "rotation_euler", [(0, 0, -0.1), (0, 0, 0), (0, 0, 0.1)])
    animate(points, "location", [(0, 0, -3), (0, 0, 0), (0, 0, 1)])
    scene.frame_set(5)
    turning = np.sin(0.1) * np.cross(UP, GRID_POINTS)
    np.testing.assert_allclose(read("velocity")[0], turning + (1, 0, 0) + 2 * UP, atol=1e-5)


def test_velocities_of_an_object_that_stands_still_are_enough(scene, read):
    """Whatever else moves, and changes."""
    points = scene.objects["Points"]
    store(points.data, "velocity", "FLOAT_VECTOR", "vector", [UP] * 4)
    _, (to_points,) = add_geometry_nodes(
        points, "GeometryNodeMeshToPoints"
    )  # further geometry, which Blender lists as an instance
    to_points.inputs["Radius"].default_value = 0.5
    animate(add_cube(scene), "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    scene.frame_set(5)
    velocities, _, frames = read("velocity")
    np.testing.assert_array_equal(velocities, [UP] * 4)
    assert frames == []


def test_velocities_of_instances_are_those_of_points_and_of_what_makes_them(scene, read):
    group = bpy.data.collections.new("Group")
    points = add_points(group, "Instanced")
    store(points.data, "velocity", "FLOAT_VECTOR", "vector", [(1, 0, 0)] * 4)
    scene.objects["Points"].meniscus.use_fluid = False
    animate(instance_collection(scene, group), "location", [(0, 0, -3), (0, 0, 0), (0, 0, 1)])
    scene.frame_set(5)
    np.testing.assert_allclose(read("velocity")[0], [(1, 0, 2)] * 4, atol=1e-5)


@pytest.mark.parametrize("has_neighbors", [True, False], ids=["", "after only"])
def test_a_look_of_speeds_has_them_while_the_shutter_is_open(scene, read_all, has_neighbors):
    points = scene.objects["Points"]
    animate(points, "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    for curve in _curves(points):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    if not has_neighbors:
        points.meniscus.radius_attribute = "Missing"
        animate(points.meniscus, "radius_mode", ["ATTRIBUTE", "FIXED", "FIXED"])
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, 0.5, "START"
    scene.meniscus.render_style = "speed"
    scene.frame_set(5)
    found, frames = read_all("combined", samples=2)
    assert frames == [4, 6, 5.125, 5.375, 5]
    expected = 2 * UP if has_neighbors else 3 * UP
    for moment in (found.moment, *found.shutter):
        np.testing.assert_allclose(moment.fluid.balls.velocities, [expected] * 4, atol=1e-4)
    scene.meniscus.render_style = "headlight"
    found, frames = read_all("combined", samples=2)
    assert frames == [5.125, 5.375, 5]
    assert found.shutter[0].fluid.balls.velocities is None


@pytest.mark.parametrize(("lacking", "expected"), [((4,), 3), ((6,), 1)])
def test_a_neighbour_that_cannot_be_read_does_not_count(scene, read, lacking, expected):
    points = scene.objects["Points"]
    animate(points, "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    points.meniscus.radius_attribute = "Missing"
    for frame in (4, 5, 6):
        points.meniscus.radius_mode = "ATTRIBUTE" if frame in lacking else "FIXED"
        points.meniscus.keyframe_insert("radius_mode", frame=frame)
    scene.frame_set(5)
    np.testing.assert_allclose(read("velocity")[0], [expected * UP] * 4, atol=1e-6)


def test_without_neighbours_nothing_is_known_to_move(scene, read):
    points = scene.objects["Points"]
    animate(points.meniscus, "use_fluid", [False, True, False])
    scene.frame_set(5)
    velocities, _, frames = read("velocity")
    assert velocities is None
    assert frames == [4, 6, 5]


def test_meshes_move_part_by_part(scene, read):
    """One is there at this frame only, one changes its number of vertices."""
    guest, steady, growing = (add_cube(scene) for _ in range(3))
    for cube in (guest, steady, growing):
        animate(cube, "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    for path in ("hide_viewport", "hide_render"):
        animate(guest, path, [True, False, True])
    animate(growing.modifiers.new("Array", "ARRAY"), "count", [1, 2, 2])
    scene.frame_set(5)
    _, motion, _ = read("vector")
    before, after = (
        vertices[:, 2].reshape(-1, 8).mean(axis=1).round(3).tolist()
        for vertices in (motion.previous_vertices, motion.following_vertices)
    )
    assert before == [1, 0, 1, 1]
    assert after == [1, 4, 4, 4]


def test_of_meshes_only_those_are_read_again_that_may_move(scene, read, module, monkeypatch):
    reader, names = module("read_meshes"), []
    read_positions = reader._read_positions
    monkeypatch.setattr(reader, "_read_positions", lambda mesh: names.append(mesh.name) or read_positions(mesh))
    add_cube(scene).data.name = "Still"
    moving = add_cube(scene)
    moving.data.name = "Moving"
    animate(moving, "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    scene.frame_set(5)
    _, motion, _ = read("vector")
    assert names == ["Moving", "Moving"]
    heights = motion.following_vertices[:, 2].reshape(-1, 8).mean(axis=1)
    assert sorted(heights.round(3)) == [0, 4]


def _moving_light(scene):
    """What moves without being a surface."""
    light = add_object(scene.collection, "Light", bpy.data.lights.new("Light", "POINT"))
    animate(light, "location", [(0, 0, 0), (0, 0, 1), (0, 0, 4)])
    return light


def _parent(scene, item):
    item.parent = _moving_light(scene)


def _constraint(scene, item):
    item.constraints.new("COPY_LOCATION").target = _moving_light(scene)


def _shape_key(scene, item):
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="Flat")
    for point in key.data:
        point.co.z = 0
    animate(key, "value", [0, 0.5, 1])


def _modifier(scene, item):
    item.modifiers.new("Wave", "WAVE")


def _data(scene, item):
    curve = bpy.data.curves.new("Curve", "FONT")
    curve.body = "M"
    animate(curve, "extrude", [0.1, 0.2, 0.3])
    add_object(scene.collection, "Text", curve)


@pytest.mark.parametrize("make_move", [_parent, _constraint, _shape_key, _modifier, _data])
def test_what_moves_is_noticed(scene, read, make_move):
    make_move(scene, add_cube(scene))
    scene.frame_set(5)
    _, motion, frames = read("vector")
    assert frames == [4, 6, 5]
    assert motion.previous_vertices is not None


class TestMatching:
    """Points that change between frames."""

    @pytest.fixture
    def frame(self, module, scene):
        """Reads the parts of the scene after replacing its points."""

        def with_points(positions, ids=None):
            data = bpy.data.meshes.new("Points")
            data.from_pydata(np.asarray(positions, float).tolist(), [], [])
            store(data, "radius", "FLOAT", "value", [0.5] * len(positions))
            if ids is not None:
                store(data, "id", "INT", "value", ids)
            scene.objects["Points"].data = data
            return module("read_scene").read_parts(bpy.context.evaluated_depsgraph_get())

        return with_points

    @pytest.fixture
    def moving(self, module):
        """The velocities of a fluid, given those of the frames before and after."""
        return lambda *frames: module("fluid_motion").with_motion(*frames, SECONDS).joined().balls.velocities

    def test_by_ids(self, frame, moving):
        now = frame([(0, 0, 0), (5, 0, 0), (9, 0, 0), (7, 0, 0)], [3, 8, -2, 4])
        before = frame([(5, 1, 0), (0, 1, 0)], [8, 3])
        after = frame([(9, 4, 0), (0, 4, 0), (1, 1, 1)], [-2, 3, 77])
        np.testing.assert_allclose(moving(now, before, after), [(0, 3, 0), (0, -2, 0), (0, 8, 0), (0, 0, 0)])

    def test_by_order_where_there_are_as_many(self, frame, moving):
        now, after = frame([(0, 0, 0), (5, 0, 0)]), frame([(0, 4, 0), (5, 1, 0)])
        fewer = frame([(0, 0, 0)])
        np.testing.assert_allclose(moving(now, fewer, after), [(0, 8, 0), (0, 2, 0)])
        np.testing.assert_allclose(moving(now, None, fewer), np.zeros((2, 3)))

    def test_sources_are_matched_by_name(self, scene, frame, moving):
        add_points(scene.collection, "Other", [(0, 0, 7)])
        now = frame([(0, 0, 0)])
        scene.objects["Points"].location = (0, 0, 1)
        after = frame([(0, 0, 0)])
        scene.objects["Points"].meniscus.use_fluid = False
        before = frame([(0, 0, 0)])
        assert sorted(moving(now, before, after)[:, 2]) == [0, 2]
