"""Legacy particle systems become balls."""

import bpy
import numpy as np
import pytest
from fluid_scenes import (
    add_emitter,
    add_geometry_nodes,
    add_particle_system,
    assert_same_points,
    input_error,
    instance_collection,
    play,
    read_balls,
)
from mathutils import Matrix


def particles_by_blender(item, index=0):
    """Location, velocity and size of the living particles, one by one as Blender gives them."""
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    living = [particle for particle in evaluated.particle_systems[index].particles if particle.alive_state == "ALIVE"]
    return tuple(np.array([getattr(particle, name)[:] for particle in living]) for name in ("location", "velocity")) + (
        np.array([particle.size for particle in living]),
    )


def add_fluid_domain(cache):
    """A box, 4 by 3 by 4, in which a cube of liquid begins to fall."""
    bpy.ops.mesh.primitive_cube_add(size=2)
    domain = bpy.context.object
    domain.scale = (2.0, 1.5, 2.0)
    modifier = domain.modifiers.new("Fluid", "FLUID")
    modifier.fluid_type = "DOMAIN"
    settings = modifier.domain_settings
    settings.domain_type, settings.resolution_max = "LIQUID", 32
    settings.cache_directory, settings.cache_type, settings.cache_frame_end = str(cache), "ALL", 9
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 1))
    flow = bpy.context.object.modifiers.new("Fluid", "FLUID")
    flow.fluid_type = "FLOW"
    flow.flow_settings.flow_type, flow.flow_settings.flow_behavior = "LIQUID", "GEOMETRY"
    return domain


def test_living_particles_are_read_and_no_others(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, frame_end=20, lifetime=5, size_random=0.5)
    play(empty_scene, 12)
    locations, _, sizes = particles_by_blender(item)
    assert 5 < len(locations) < 45
    balls = read_balls(meniscus)
    np.testing.assert_array_equal(balls.positions, locations.astype(np.float32))
    np.testing.assert_array_equal(balls.radii, sizes.astype(np.float32))


def test_radius_is_size_times_factor(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, particle_size=0.25)
    item.meniscus.radius_factor = 3.0
    play(empty_scene, 2)
    np.testing.assert_allclose(read_balls(meniscus).radii, np.full(50, 0.75), rtol=1e-6)


def test_fixed_radius_weight_and_colour_are_those_of_the_object(meniscus, empty_scene):
    settings = add_emitter(empty_scene.collection).meniscus
    settings.radius_mode, settings.radius = "FIXED", 0.3
    settings.weight = -0.5
    settings.color_mode, settings.color = "FIXED", (0.1, 0.2, 0.7)
    play(empty_scene, 2)
    balls = read_balls(meniscus)
    np.testing.assert_allclose(balls.radii, np.full(50, 0.3), rtol=1e-6)
    np.testing.assert_allclose(balls.weights, np.full(50, -0.5))
    np.testing.assert_allclose(balls.colors, np.tile((0.1, 0.2, 0.7), (50, 1)), rtol=1e-6)


def test_velocity_is_distance_a_second(meniscus, empty_scene):
    add_emitter(empty_scene.collection, drag_factor=0, normal_factor=2)
    empty_scene.render.fps = 30
    play(empty_scene, 10)
    before = read_balls(meniscus)
    empty_scene.frame_set(11)
    after = read_balls(meniscus)
    per_second = (after.positions - before.positions) * 30
    assert np.linalg.norm(per_second, axis=1).min() > 1
    np.testing.assert_allclose(after.velocities, per_second, rtol=1e-3, atol=1e-3)


@pytest.mark.skipif(
    not bpy.app.binary_path or bpy.app.version < (5, 0, 0),
    reason="fluid domains cannot be baked in the bpy module, and end Debian's Blender 4.3",
)
def test_velocity_of_a_fluid_domain_is_distance_a_second(meniscus, empty_scene, tmp_path):
    domain = add_fluid_domain(tmp_path)
    settings = domain.modifiers["Fluid"].domain_settings
    settings.time_scale = 0.5
    with bpy.context.temp_override(object=domain, active_object=domain):
        bpy.ops.fluid.bake_all()
    domain.meniscus.use_fluid = True
    empty_scene.frame_set(7)
    before = read_balls(meniscus)
    empty_scene.frame_set(8)
    fall = (read_balls(meniscus).positions[:, 2].mean() - before.positions[:, 2].mean()) * empty_scene.render.fps
    assert fall < -0.1
    assert before.velocities[:, 2].mean() == pytest.approx(fall, rel=0.1)


def test_subframe_is_between_its_frames(meniscus, empty_scene):
    add_emitter(empty_scene.collection, drag_factor=0)
    play(empty_scene, 5)
    heights = [read_balls(meniscus).positions[:, 2]]
    for frame, subframe in ((5, 0.5), (6, 0.0)):
        empty_scene.frame_set(frame, subframe=subframe)
        heights.append(read_balls(meniscus).positions[:, 2])
    np.testing.assert_allclose(heights[1], (heights[0] + heights[2]) / 2, atol=1e-5)
    assert np.all(heights[2] > heights[0])


def test_positions_are_in_world_space_whatever_the_emitters_transform(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    item.location, item.scale, item.rotation_euler = (5.0, 6.0, 7.0), (0.1, 0.1, 0.1), (0.3, 0.2, 0.1)
    play(empty_scene, 1)
    balls = read_balls(meniscus)
    assert np.abs(balls.positions - (5, 6, 7)).max() < 0.2
    np.testing.assert_allclose(balls.radii, np.full(50, 0.1), rtol=1e-6)


def test_several_systems_are_read_together_and_hair_is_not(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    add_particle_system(item, count=20, particle_size=0.4)
    add_particle_system(item, count=30, type="HAIR").show_viewport = False
    play(empty_scene, 3)
    balls = read_balls(meniscus)
    assert len(balls) == 70
    assert np.count_nonzero(np.isclose(balls.radii, 0.4)) == 20
    assert balls.ids is None


def test_emitter_whose_nodes_make_points_is_read_once(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    add_geometry_nodes(item, "GeometryNodeMeshToPoints")
    play(empty_scene, 2)
    assert len(read_balls(meniscus)) == 50


def test_object_with_hair_only_is_read_as_points(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, type="HAIR")
    item.meniscus.radius_mode = "FIXED"
    assert len(read_balls(meniscus)) == 4


def test_fluid_physics_is_read(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, physics_type="FLUID")
    play(empty_scene, 8)
    locations, _, _ = particles_by_blender(item)
    assert len(locations) == 50
    np.testing.assert_array_equal(read_balls(meniscus).positions, locations.astype(np.float32))


def test_ids_name_particles_over_time(meniscus, empty_scene):
    add_emitter(empty_scene.collection, frame_end=10, lifetime=6, drag_factor=0)
    play(empty_scene, 8)
    before = read_balls(meniscus)
    empty_scene.frame_set(9)
    after = read_balls(meniscus)
    _, then, now = np.intersect1d(before.ids, after.ids, return_indices=True)
    assert 0 < len(now) < len(after)
    np.testing.assert_allclose(after.positions[now, :2], before.positions[then, :2], atol=1e-4)


def test_emitter_before_its_start_gives_no_balls_and_no_error(meniscus, empty_scene):
    add_emitter(empty_scene.collection, frame_start=10, frame_end=20)
    play(empty_scene, 3)
    assert len(read_balls(meniscus)) == 0


def test_instances_of_an_emitter_carry_its_particles(meniscus, empty_scene):
    collection = bpy.data.collections.new("Fluid")
    empty_scene.collection.children.link(collection)
    item = add_emitter(collection, drag_factor=0)
    item.location = (1.0, 2.0, 3.0)
    instance_collection(empty_scene, collection, location=(10.0, 0.0, 0.0), scale=(2.0, 2.0, 2.0), rotation_euler=(0, 0, 1.0))
    play(empty_scene, 4)
    locations, velocities, _ = particles_by_blender(item)
    place = np.array(Matrix.LocRotScale((10, 0, 0), Matrix.Rotation(1.0, 3, "Z"), (2, 2, 2)))
    balls = read_balls(meniscus)
    moved = locations @ place[:3, :3].T + place[:3, 3]
    assert_same_points(balls.positions, np.concatenate((locations, moved)))
    assert sorted(set(np.round(balls.radii, 5))) == pytest.approx([0.1, 0.2])
    speeds = np.linalg.norm(balls.velocities, axis=1) / np.linalg.norm(velocities, axis=1).mean()
    assert sorted(set(np.round(speeds / speeds.min(), 3))) == [1.0, 2.0]


def test_particles_that_the_viewport_leaves_out_are_not_read(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, display_percentage=40)
    play(empty_scene, 6)
    balls = read_balls(meniscus, viewport=True)
    assert 5 < len(balls) < 40
    heights = balls.positions[:, 2]
    assert heights.max() - heights.min() < 1e-4
    assert len(particles_by_blender(item)[0]) > len(balls)


def test_system_that_the_viewport_thins_out_is_an_error_in_renders(meniscus, empty_scene):
    add_emitter(empty_scene.collection, display_percentage=40)
    play(empty_scene, 6)
    with pytest.raises(input_error(meniscus), match="of 'Emitter' is shown to 40 % in the viewport"):
        read_balls(meniscus)


def test_system_that_renders_do_not_show_is_read_for_the_viewport_only(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    add_particle_system(item, count=20).show_render = False
    play(empty_scene, 2)
    assert len(read_balls(meniscus)) == 50
    assert len(read_balls(meniscus, viewport=True)) == 70


def test_system_that_is_off_in_the_viewport_only_is_an_error_in_renders(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    item.modifiers[0].show_viewport = False
    play(empty_scene, 2)
    assert len(read_balls(meniscus, viewport=True)) == 0
    with pytest.raises(input_error(meniscus), match="of 'Emitter' is shown in renders only"):
        read_balls(meniscus)


def test_particles_drawn_as_objects_are_read_once(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    drawn = bpy.data.objects.new("Drawn", bpy.data.meshes.new("Drawn"))
    empty_scene.collection.objects.link(drawn)
    settings = item.particle_systems[0].settings
    settings.render_type, settings.instance_object = "OBJECT", drawn
    play(empty_scene, 2)
    assert len(read_balls(meniscus)) == 50


@pytest.mark.parametrize("setting", ["radius_mode", "color_mode"])
def test_attribute_of_particles_is_an_error_that_names_the_object(meniscus, empty_scene, setting):
    setattr(add_emitter(empty_scene.collection).meniscus, setting, "ATTRIBUTE")
    play(empty_scene, 2)
    with pytest.raises(input_error(meniscus), match="'Emitter' have no attributes"):
        read_balls(meniscus)


def test_object_without_particle_system_is_an_error_where_particles_are_asked_for(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection)
    item.modifiers.clear()
    item.meniscus.source = "PARTICLES"
    with pytest.raises(input_error(meniscus), match="'Emitter' has no particle system"):
        read_balls(meniscus)
