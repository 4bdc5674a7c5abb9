"""What the buttons do: sources come and go, presets apply, problems can be copied."""

import importlib

import bpy
import pytest
from fluid_scenes import GRID_POINTS, add_geometry_nodes, add_object, add_particle_system, add_points


def module(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.{name}")


@pytest.fixture
def scene(empty_scene):
    return empty_scene


def cube(scene, name="Cube"):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    return add_object(scene.collection, name, mesh)


def select(*items):
    bpy.context.view_layer.update()
    for item in bpy.context.view_layer.objects:
        item.select_set(item in items)


def test_an_emitter_becomes_a_source_and_its_dots_are_hidden_until_it_is_removed(scene):
    emitter = cube(scene)
    settings = add_particle_system(emitter, display_method="CROSS").particle_system.settings
    select(emitter)
    assert bpy.ops.meniscus.add_sources() == {"FINISHED"}
    assert emitter.meniscus.use_fluid
    assert settings.display_method == "NONE"
    assert bpy.ops.meniscus.remove_source() == {"FINISHED"}
    assert not emitter.meniscus.use_fluid
    assert settings.display_method == "CROSS"
    assert len(settings.keys()) == 0


def test_shared_particles_stay_hidden_until_the_last_of_their_sources_is_removed(scene):
    first, second = cube(scene, "A"), cube(scene, "B")
    settings = add_particle_system(first, display_method="CROSS").particle_system.settings
    add_particle_system(second).particle_system.settings = settings
    select(first, second)
    bpy.ops.meniscus.add_sources()
    bpy.ops.meniscus.remove_source()
    assert settings.display_method == "NONE"
    bpy.ops.meniscus.remove_source()
    assert settings.display_method == "CROSS"


def test_a_display_that_was_chosen_since_stays(scene):
    emitter = cube(scene)
    settings = add_particle_system(emitter, display_method="CROSS").particle_system.settings
    select(emitter)
    bpy.ops.meniscus.add_sources()
    settings.display_method = "CIRC"
    bpy.ops.meniscus.remove_source()
    assert (settings.display_method, len(settings.keys())) == ("CIRC", 0)


def test_adding_a_source_can_be_undone(scene):
    emitter = cube(scene)
    add_particle_system(emitter, display_method="CROSS")
    select(emitter)
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.meniscus.add_sources()
    bpy.ops.ed.undo_push(message="Use as Fluid")
    bpy.ops.ed.undo()
    emitter = bpy.data.objects["Cube"]
    assert not emitter.meniscus.use_fluid
    assert emitter.particle_systems[0].settings.display_method == "CROSS"
    bpy.ops.ed.redo()
    assert bpy.data.objects["Cube"].meniscus.use_fluid


def test_hair_keeps_its_display(scene):
    emitter = cube(scene)
    hair = add_particle_system(emitter, type="HAIR", display_method="PATH").particle_system.settings
    add_particle_system(emitter)
    select(emitter)
    bpy.ops.meniscus.add_sources()
    assert hair.display_method == "PATH"


def test_only_objects_with_particles_or_points_become_sources(scene):
    plain, points, nodes = cube(scene, "Plain"), cube(scene, "Loose"), cube(scene, "Nodes")
    points.data.clear_geometry()
    points.data.from_pydata(GRID_POINTS.tolist(), [], [])
    add_geometry_nodes(nodes, "GeometryNodeMeshToPoints")
    select(plain, points, nodes)
    assert bpy.ops.meniscus.add_sources() == {"FINISHED"}
    assert [item.meniscus.use_fluid for item in (plain, points, nodes)] == [False, True, True]
    select(plain)
    assert bpy.ops.meniscus.add_sources() == {"CANCELLED"}
    assert not plain.meniscus.use_fluid


def test_nothing_selected_and_no_source_say_why_not(scene):
    cube(scene)
    select()
    with pytest.raises(RuntimeError, match="Select an object that has particles or points"):
        bpy.ops.meniscus.add_sources()
    with pytest.raises(RuntimeError, match="The scene has no source"):
        bpy.ops.meniscus.remove_source()
    with pytest.raises(RuntimeError, match="There is no problem"):
        bpy.ops.meniscus.copy_problem()


def test_the_chosen_source_is_the_one_that_is_removed_and_selected(meniscus, scene):
    first, plain, second = (add_points(scene.collection, "A"), cube(scene, "B"), add_points(scene.collection, "C"))
    sources = module(meniscus, "sources")
    assert sources.active_source(scene) == first
    scene.meniscus.source_index = scene.objects.find("C")
    assert bpy.ops.meniscus.select_source() == {"FINISHED"}
    assert list(bpy.context.view_layer.objects.selected) == [bpy.context.view_layer.objects.active] == [second]
    bpy.ops.meniscus.remove_source()
    assert (first.meniscus.use_fluid, second.meniscus.use_fluid) == (True, False)
    scene.meniscus.source_index = scene.objects.find(plain.name)
    assert sources.active_source(scene) == first


def test_the_list_follows_what_is_made_deleted_and_undone(meniscus, scene):
    sources = module(meniscus, "sources")
    assert not sources.has_sources(scene)
    item = add_points(scene.collection)
    assert sources.source_flags(scene) == [True]
    bpy.data.objects.remove(item)
    cube(scene)
    bpy.context.view_layer.update()
    assert sources.source_flags(scene) == [False]


@pytest.mark.parametrize("name", ["water", "slime", "mercury", "molecules"])
def test_presets_set_all_of_field_and_look(meniscus, scene, name):
    preset = module(meniscus, "presets").PRESETS[name]
    reader = module(meniscus, "read_scene")
    scene.meniscus.absorption, scene.meniscus.light_strength, scene.meniscus.depth_contrast = 9.0, 3.0, 5.0
    assert bpy.ops.meniscus.apply_preset(preset=name) == {"FINISHED"}
    field, look = reader.read_field(scene), reader.read_look(scene, scene.meniscus.style)
    assert (field.kernel, field.isovalue) == (preset.field.kernel, pytest.approx(preset.field.isovalue))
    assert look.style == preset.look.style
    numbers = ("ambient", "roughness", "metallic", "light_strength", "absorption", "ior", "depth_contrast")
    for number in numbers:
        assert getattr(look, number) == pytest.approx(getattr(preset.look, number)), number
    assert look.color == pytest.approx(preset.look.color)


def test_presets_differ(meniscus):
    presets = module(meniscus, "presets").PRESETS.values()
    assert len({(preset.field, preset.look) for preset in presets}) == len(presets) == 4


def test_a_problem_is_told_with_versions(meniscus, scene):
    status, operators = module(meniscus, "viewport_status").STATUS, module(meniscus, "operators")
    status.report("Nothing works", "Traceback of nothing")
    try:
        text = operators.problem_text()
    finally:
        status.clear()
    assert text.splitlines()[0] == "Nothing works"
    assert bpy.app.version_string in text
    assert text.endswith("Traceback of nothing")
