"""The settings of objects and scenes: what they mean, and that they are saved."""

import importlib

import bpy
import numpy as np
import pytest
from fluid_scenes import add_emitter, add_points, play, read_balls


def module(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.{name}")


def own_properties(group):
    return [group.bl_rna.properties[name] for name in group.__annotations__]


def test_field_and_look_of_a_new_scene_are_the_defaults(meniscus, empty_scene):
    reader = module(meniscus, "addon.blender.read_scene")
    field, look = module(meniscus, "addon.fluid.field").Field(), module(meniscus, "addon.fluid.look").Look()
    read_field, read_look = reader.read_field(empty_scene), reader.read_look(empty_scene, empty_scene.meniscus.style)
    assert (read_field.kernel, read_field.isovalue) == (field.kernel, pytest.approx(field.isovalue))
    assert (read_look.color, read_look.ambient) == (pytest.approx(look.color), pytest.approx(look.ambient))
    assert read_look.depth_contrast == look.depth_contrast == 0
    assert read_look.depth_contrast_radius == pytest.approx(look.depth_contrast_radius)


def test_field_and_look_are_those_of_the_scene(meniscus, empty_scene):
    reader = module(meniscus, "addon.blender.read_scene")
    settings = empty_scene.meniscus
    settings.isovalue, settings.color, settings.ambient = 0.75, (0.5, 0.25, 0.125), 0.5
    settings.depth_contrast, settings.depth_contrast_radius = 2.5, 0.0625
    for kernel in module(meniscus, "addon.fluid.kernels").KERNELS:
        settings.kernel = kernel
        assert reader.read_field(empty_scene).kernel == kernel
    assert reader.read_field(empty_scene).isovalue == 0.75
    look = reader.read_look(empty_scene, empty_scene.meniscus.style)
    assert (look.color, look.ambient) == ((0.5, 0.25, 0.125), 0.5)
    assert (look.depth_contrast, look.depth_contrast_radius) == (2.5, 0.0625)


@pytest.mark.parametrize("extreme", [-1e9, 1e9])
def test_every_depth_contrast_that_can_be_set_can_be_rendered(meniscus, empty_scene, extreme):
    settings = empty_scene.meniscus
    settings.depth_contrast = settings.depth_contrast_radius = extreme
    look = module(meniscus, "addon.blender.read_scene").read_look(empty_scene, empty_scene.meniscus.style)
    assert look.depth_contrast == (100 if extreme > 0 else 0)


def test_settings_survive_saving_and_loading(meniscus, empty_scene, tmp_path):
    item = add_points(empty_scene.collection)
    item.meniscus.radius_mode, item.meniscus.weight = "FIXED", -1.5
    empty_scene.meniscus.kernel, empty_scene.meniscus.backend = "poly6", "cpu"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "fluid.blend"), check_existing=False)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "fluid.blend"))
    settings, scene_settings = bpy.data.objects["Points"].meniscus, bpy.context.scene.meniscus
    assert (settings.use_fluid, settings.radius_mode, settings.weight) == (True, "FIXED", -1.5)
    assert (scene_settings.kernel, scene_settings.backend) == ("poly6", "cpu")


def test_every_registered_method_can_be_chosen(meniscus, empty_scene):
    names = [info.name for info in module(meniscus, "addon.render.registry").method_infos()]
    assert names
    for name in ("auto", *names):
        empty_scene.meniscus.method = name
        assert empty_scene.meniscus.method == name


def test_number_of_a_choice_does_not_depend_on_the_other_choices(meniscus):
    stable_items = module(meniscus, "addon.blender.properties").stable_items
    items = [(name, name.title(), name) for name in ("auto", "one", "two")]
    numbers = {name: number for name, _, _, number in stable_items(items)}
    with_a_new_one = {name: number for name, _, _, number in stable_items([("new", "New", ""), *reversed(items)])}
    assert numbers.items() <= with_a_new_one.items()
    assert len(set(with_a_new_one.values())) == 4


def test_every_property_has_a_description_without_full_stop(meniscus):
    properties = module(meniscus, "addon.blender.properties")
    for group in (properties.MENISCUS_PG_object, properties.MENISCUS_PG_scene):
        for own in own_properties(group):
            texts = [own.description, *(item.description for item in getattr(own, "enum_items", ()))]
            for text in texts:
                assert text.strip(), own.identifier
                assert not text.endswith("."), own.identifier


def test_settings_hold_at_once_for_what_was_evaluated_before(meniscus, empty_scene):
    item = add_points(empty_scene.collection)
    item.meniscus.color_mode = "LOOK"
    painted = add_points(empty_scene.collection, "Painted")
    painted.meniscus.color_mode = "FIXED"
    assert len(read_balls(meniscus)) == 8
    painted.meniscus.color = (0.0, 1.0, 0.0)
    item.meniscus.radius_factor = painted.meniscus.radius_factor = 4.0
    empty_scene.meniscus.color = (1.0, 0.0, 0.0)
    balls = read_balls(meniscus)
    assert sorted(map(tuple, balls.colors.tolist())) == [(0.0, 1.0, 0.0)] * 4 + [(1.0, 0.0, 0.0)] * 4
    assert set(balls.radii.tolist()) == {2.0}
    painted.meniscus.use_fluid = False
    assert len(read_balls(meniscus)) == 4


def test_changing_a_setting_of_the_scene_leaves_an_unbaked_simulation_as_it_is(meniscus, empty_scene):
    item = add_emitter(empty_scene.collection, physics_type="FLUID", count=500, frame_end=30)
    item.particle_systems[0].settings.effector_weights.gravity = 1
    play(empty_scene, 20)
    before = read_balls(meniscus).positions
    empty_scene.meniscus.isovalue = 0.5
    empty_scene.meniscus.style = "water"
    np.testing.assert_array_equal(read_balls(meniscus).positions, before)
