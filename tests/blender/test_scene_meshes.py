"""Meshes beside the fluid: seen where Cycles sees them, in front of fluid or behind it."""

import bpy
import numpy as np
import pytest
from cycles_depth import passes_of_render, set_up_cycles
from fluid_scenes import add_object, add_points, instance_collection
from mathutils import Euler


def add_mesh(collection, make, name, smooth=False):
    """An object with what one of Blender's operators makes."""
    make()
    item = bpy.context.object
    item.name = name
    for owner in item.users_collection:
        owner.objects.unlink(item)
    collection.objects.link(item)
    if smooth:
        for polygon in item.data.polygons:
            polygon.use_smooth = True
    return item


@pytest.fixture
def scene(empty_scene):
    """A scene with a camera and no fluid that is seen."""
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (1, -7, 2), (1.3, 0.05, 0.15)
    camera.data.clip_end = 30
    empty_scene.camera = camera
    render = empty_scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 128, 96, 100
    render.film_transparent, empty_scene.meniscus.render_samples = True, 1
    set_up_cycles(empty_scene)
    for name in ("z", "normal", "position", "object_index"):
        setattr(empty_scene.view_layers[0], f"use_pass_{name}", True)
    add_points(empty_scene.collection, "Fluid", [(0, 0, 0)], 0.9)
    return empty_scene


@pytest.fixture
def render(scene, tmp_path):
    def by(engine):
        scene.render.engine = engine
        scene.objects["Fluid"].hide_render = engine == "CYCLES"
        return passes_of_render(scene, tmp_path / f"{engine}.exr")[0]

    return by


def test_depth_and_normals_are_those_of_cycles(scene, render):
    """Smooth and flat meshes, mirrored, scaled, cut by the eye's plane; instances, curves, modifiers; not what is hidden."""
    collection = scene.collection
    head = add_mesh(collection, bpy.ops.mesh.primitive_monkey_add, "Head", smooth=True)
    head.location, head.scale, head.rotation_euler = (-1.5, 0, 0.5), (-1, 1.2, 0.8), Euler((0.2, 0.1, 0.6))
    head.pass_index = 3
    floor = add_mesh(collection, bpy.ops.mesh.primitive_plane_add, "Floor")
    floor.scale, floor.location = (40, 40, 1), (0, 0, -1.2)
    curve = add_mesh(collection, bpy.ops.curve.primitive_bezier_circle_add, "Ring")
    curve.data.bevel_depth, curve.location = 0.1, (1.5, 1, 1)
    cube = add_mesh(collection, bpy.ops.mesh.primitive_cube_add, "Cube")
    cube.location, cube.scale = (2, 0, -0.5), (0.5, 0.4, 0.6)
    cube.modifiers.new("Array", "ARRAY").count = 2
    group = bpy.data.collections.new("Group")
    cone = add_mesh(group, bpy.ops.mesh.primitive_cone_add, "Cone")
    cone.location = (0, 2, 0)
    instance_collection(scene, group, "First", location=(1.2, 2.0, 1.0))
    instance_collection(scene, group, "Second", location=(-1.0, 3.0, 1.0), rotation_euler=(1, 0, 0))
    hidden = add_mesh(collection, bpy.ops.mesh.primitive_uv_sphere_add, "Hidden")
    hidden.location, hidden.hide_render = (0, -2, 0), True
    expected = render("CYCLES")
    scene.objects["Fluid"].location = (0, -100, 0)
    actual = render("MENISCUS")
    hit, wanted = actual["ViewLayer.Depth.Z"] < 1e9, expected["ViewLayer.Depth.Z"] < 1e9
    assert 0.5 < hit.mean() < 0.98
    assert (hit != wanted).mean() < 0.003
    both = hit & wanted
    relative = np.abs(actual["ViewLayer.Depth.Z"] / expected["ViewLayer.Depth.Z"] - 1)[both]
    assert np.quantile(relative, 0.985) < 2e-4
    for channel in "XYZ":
        for name, tolerance in (("Normal", 0.02), ("Position", 5e-3)):
            difference = np.abs(actual[f"ViewLayer.{name}.{channel}"] - expected[f"ViewLayer.{name}.{channel}"])[both]
            assert np.quantile(difference, 0.97) < tolerance, name
    (index,) = (name for name in actual if "Index" in name)
    assert (actual[index] != expected[index])[both].mean() < 0.01
    assert (actual[index] == 3).any()


def test_fluid_is_hidden_and_hides_at_every_pixel(scene, render):
    alone = render("MENISCUS")
    wall = add_mesh(scene.collection, bpy.ops.mesh.primitive_plane_add, "Wall")
    wall.rotation_euler, wall.scale, wall.pass_index = (1.2, 0.3, 1.2), (3, 3, 1), 4
    both = render("MENISCUS")
    scene.objects["Fluid"].location = (0, -100, 0)
    behind = render("MENISCUS")
    depth = "ViewLayer.Depth.Z"
    np.testing.assert_array_equal(both[depth], np.minimum(alone[depth], behind[depth]))
    (index,) = (name for name in both if "Index" in name)
    fluid = alone[depth] < behind[depth]
    assert (fluid & (both[index] == 0)).mean() > 0.01
    assert ((alone[depth] < 1e9) & ~fluid).mean() > 0.01
    np.testing.assert_array_equal(both[index][~fluid & (behind[depth] < 1e9)], 4)
    assert both["ViewLayer.Combined.A"][behind[depth] < 1e9].min() == 1


@pytest.mark.parametrize("choice", ["scene", "object"])
def test_holdouts_leave_holes(scene, render, choice):
    wall = add_mesh(scene.collection, bpy.ops.mesh.primitive_plane_add, "Wall")
    wall.rotation_euler, wall.scale = (1.2, 0.3, 0.2), (3, 3, 1)
    shown = render("MENISCUS")
    if choice == "scene":
        scene.meniscus.render_meshes = "HOLDOUT"
    else:
        wall.is_holdout = True
    held_out = render("MENISCUS")
    fluid = np.isclose(held_out["ViewLayer.Depth.Z"], shown["ViewLayer.Depth.Z"]) & (shown["ViewLayer.Depth.Z"] < 1e9)
    assert 0.01 < fluid.mean() < 0.5
    np.testing.assert_array_equal(held_out["ViewLayer.Combined.A"] > 0, fluid)
    scene.meniscus.render_meshes = "NONE"
    alone = render("MENISCUS")
    assert (alone["ViewLayer.Combined.A"] > 0).sum() > fluid.sum()


def test_points_and_their_particles_are_not_shown_twice(scene, render):
    """A fluid of vertices does not show its faces, an emitter does, but not what it would draw for its particles."""
    grid = add_mesh(scene.collection, lambda: bpy.ops.mesh.primitive_grid_add(x_subdivisions=3, y_subdivisions=3), "Grid")
    grid.meniscus.use_fluid, grid.meniscus.radius_mode, grid.meniscus.radius = True, "FIXED", 0.3
    grid.rotation_euler, grid.pass_index = (1.2, 0, 0), 9
    passes = render("MENISCUS")
    (index,) = (name for name in passes if "Index" in name)
    covered = (passes[index] == 9).sum()
    grid.meniscus.use_fluid = False
    assert (render("MENISCUS")[index] == 9).sum() > 1.3 * covered > 0


def test_vectors_are_those_of_cycles(scene, render):
    """Of meshes that move, turn, grow, are deformed, carried along, instanced or stand still, by a camera that moves too."""
    collection, camera = scene.collection, scene.objects["Camera"]
    floor = add_mesh(collection, bpy.ops.mesh.primitive_plane_add, "Floor")
    floor.scale, floor.location = (40, 40, 1), (0, 0, -1.2)
    head = add_mesh(collection, bpy.ops.mesh.primitive_monkey_add, "Head", smooth=True)
    head.location = (-1.5, 0, 0.5)
    cube = add_mesh(collection, bpy.ops.mesh.primitive_cube_add, "Cube")
    cube.parent, cube.location, cube.scale = head, (3, 0, -0.5), (0.5, 0.4, 0.6)
    grid = add_mesh(collection, lambda: bpy.ops.mesh.primitive_grid_add(x_subdivisions=9, y_subdivisions=9), "Grid")
    grid.location, grid.rotation_euler = (0.8, 1, 1.5), (1.3, 0, 0.3)
    grid.shape_key_add(name="Basis")
    bent = grid.shape_key_add(name="Bent")
    for point in bent.data:
        point.co.z, point.co.x = point.co.x * point.co.y, 0.7 * point.co.x
    group = bpy.data.collections.new("Group")
    cone = add_mesh(group, bpy.ops.mesh.primitive_cone_add, "Cone")
    cone.scale = (0.6, 0.6, 0.6)
    empty = instance_collection(scene, group, location=(2.5, 2, 0.5))
    motions = (
        (camera, "location", [(1, -7, 2), (1.02, -6.9, 2), (1.1, -6.8, 2.05)]),
        (head, "rotation_euler", [(0.2, 0.1, 0.6), (0.22, 0.1, 0.7), (0.2, 0.12, 0.9)]),
        (head, "scale", [(-1, 1.2, 0.8), (-1, 1.1, 0.8), (-1.05, 1.1, 0.8)]),
        (empty, "rotation_euler", [(1.1, 0, 0), (1, 0.1, 0), (0.8, 0.1, 0)]),
    )
    for item, path, values in motions:
        for frame, value in enumerate(values, 4):
            setattr(item, path, value)
            item.keyframe_insert(path, frame=frame)
    for frame, value in enumerate((0.1, 0.3, 0.4), 4):
        bent.value = value
        bent.keyframe_insert("value", frame=frame)
    scene.frame_set(5)
    scene.view_layers[0].use_pass_vector = True
    scene.objects["Fluid"].location = (0, -100, 0)
    expected, actual = render("CYCLES"), render("MENISCUS")
    both = (actual["ViewLayer.Depth.Z"] < 1e9) & np.isclose(
        actual["ViewLayer.Depth.Z"], expected["ViewLayer.Depth.Z"], rtol=1e-3
    )
    assert both.mean() > 0.7
    for channel in "XYZW":
        name = f"ViewLayer.Vector.{channel}"
        difference = np.abs(actual[name] - expected[name])[both]
        assert np.quantile(difference, 0.985) < 0.02, name
        assert np.ptp(expected[name][both]) > 1.5, name
    assert not actual["ViewLayer.Vector.X"][~(actual["ViewLayer.Depth.Z"] < 1e9)].any()


def test_motion_of_meshes_counts_in_the_blur(scene, render):
    cube = add_mesh(scene.collection, bpy.ops.mesh.primitive_cube_add, "Cube")
    for frame in (1, 3):
        cube.location = ((frame - 2) * 1.5, 0, 2)
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(2)
    scene.meniscus.render_samples = 8
    sharp = render("MENISCUS")["ViewLayer.Combined.A"]
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    blurred = render("MENISCUS")["ViewLayer.Combined.A"]
    assert ((blurred > 0.05) & (blurred < 0.95)).sum() > 2 * ((sharp > 0.05) & (sharp < 0.95)).sum()
