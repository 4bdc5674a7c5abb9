"""Lights, worlds and materials as traced light needs them."""

import importlib

import bpy
import numpy as np
import pytest
from fluid_scenes import add_object, add_points


@pytest.fixture
def module(meniscus):
    return lambda name: importlib.import_module(f"{meniscus.__name__}.addon.blender.{name}")


@pytest.fixture
def lighting(module):
    """Gives the lighting of the current scene and what was noted."""

    def read():
        with module("scene_notes").collected_notes() as notes:
            return module("read_lighting").read_lighting(bpy.context.evaluated_depsgraph_get()), list(notes)

    return read


def add_light(scene, kind, **settings):
    data = bpy.data.lights.new(kind, kind)
    for name, value in settings.items():
        setattr(data, name, value)
    return add_object(scene.collection, kind, data)


def test_lights_have_sizes_and_shadows(empty_scene, lighting):
    add_light(empty_scene, "POINT", shadow_soft_size=0.3)
    add_light(empty_scene, "SPOT", shadow_soft_size=0.2, use_shadow=False)
    add_light(empty_scene, "SUN", angle=0.5)
    hidden = add_light(empty_scene, "POINT")
    hidden.visible_diffuse = hidden.visible_glossy = hidden.visible_transmission = False
    found, _ = lighting()
    assert [(light.kind, pytest.approx(light.radius), light.casts_shadow) for light in found.lights] == [
        ("POINT", 0.3, True),
        ("SPOT", 0.2, False),
        ("SUN", 0.25, True),
    ]


@pytest.mark.parametrize(
    ("shape", "size", "is_round"),
    [("SQUARE", (4, 6), False), ("RECTANGLE", (4, 15), False), ("DISK", (4, 6), True), ("ELLIPSE", (4, 15), True)],
)
def test_area_lights_have_the_shape_that_they_have_in_the_scene(empty_scene, lighting, shape, size, is_round):
    item = add_light(empty_scene, "AREA", shape=shape, size=2.0, size_y=5.0)
    item.rotation_euler, item.scale = (np.pi / 2, 0, np.pi / 2), (2, 3, 1)
    (light,) = lighting()[0].lights
    assert (light.size, light.is_round) == (pytest.approx(size), is_round)
    np.testing.assert_allclose([light.right, light.direction], [(0, 1, 0), (-1, 0, 0)], atol=1e-6)


@pytest.fixture
def world(empty_scene):
    made = empty_scene.world = bpy.data.worlds.new("Sky")
    made.use_nodes, made.color = True, (0.1, 0.2, 0.3)
    return made


def add_environment(world, image, **mapping):
    """An Environment Texture before the background, and a Mapping node before that where one is asked for."""
    nodes, links = world.node_tree.nodes, world.node_tree.links
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    if mapping:
        node, coordinates = nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
        node.vector_type = mapping.pop("vector_type", "POINT")
        for name, value in mapping.items():
            node.inputs[name].default_value = value
        links.new(coordinates.outputs["Generated"], node.inputs["Vector"])
        links.new(node.outputs["Vector"], texture.inputs["Vector"])
    return texture


def add_image(pixels, is_float=True):
    height, width, _ = pixels.shape
    image = bpy.data.images.new("Light", width, height, float_buffer=is_float)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.reshape(-1))
    return image


PIXELS = np.random.default_rng(1).random((4, 8, 3), np.float32)


def test_an_image_of_the_world_keeps_its_identity_until_it_changes(world, lighting):
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 2.0
    image = add_image(PIXELS)
    add_environment(world, image)
    found, notes = lighting()
    np.testing.assert_allclose(found.image.pixels, 2 * PIXELS, rtol=1e-6)
    assert found.world == pytest.approx(found.image.mean)
    assert notes == []
    assert lighting()[0].image is found.image
    image.pixels[0] = 9.0
    assert lighting()[0].image.pixels[0, 0, 0] == 18


def test_images_of_bytes_are_made_linear(world, lighting):
    add_environment(world, add_image(np.full((2, 4, 3), 0.5, np.float32), is_float=False))
    assert lighting()[0].image.pixels == pytest.approx(0.2140, abs=0.003)


def test_a_world_that_cannot_be_read_says_so_and_has_its_display_colour(world, lighting):
    texture = add_environment(world, None)
    found, notes = lighting()
    assert found.image is None
    assert found.world == pytest.approx((0.1, 0.2, 0.3))
    assert notes == [
        "The world 'Sky' is shown in the colour of its viewport display, because its Environment Texture has no image that can "
        "be read; it may be one colour or an Environment Texture"
    ]
    texture.image = add_image(PIXELS)
    texture.projection = "MIRROR_BALL"
    assert "no equirectangular" in lighting()[1][0]
    nodes = world.node_tree.nodes
    world.node_tree.links.new(nodes.new("ShaderNodeTexSky").outputs[0], nodes["Background"].inputs["Color"])
    assert "nodes are linked to its Color" in lighting()[1][0]


def test_mappings_that_do_more_than_rotate_say_so(world, lighting):
    add_environment(world, add_image(PIXELS), Location=(0, 0, 1))
    found, notes = lighting()
    assert found.image is None
    assert "rotates" in notes[0]


@pytest.fixture
def read_material(module):
    def read(material):
        with module("scene_notes").collected_notes() as notes:
            return module("read_materials").read_material(material), list(notes)

    return read


def add_material(surface="ShaderNodeBsdfPrincipled", volume=None, **inputs):
    """A material with one node at its surface and one in its volume; inputs of the latter begin with ``volume_``."""
    material = bpy.data.materials.new("Liquid")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    for kind, socket, start in ((surface, "Surface", ""), (volume, "Volume", "volume_")):
        if kind is None:
            continue
        node = nodes.new(kind)
        material.node_tree.links.new(node.outputs[0], output.inputs[socket])
        for name, value in inputs.items():
            if name.startswith("volume_") == bool(start):
                node.inputs[name.removeprefix("volume_").replace("_", " ")].default_value = value
    return material


def test_a_clear_body_absorbs_what_its_volume_says(read_material):
    material = add_material(
        Transmission_Weight=0.75,
        IOR=1.25,
        Roughness=0.0,
        volume="ShaderNodeVolumeAbsorption",
        volume_Color=(1, 0.5, 0.25, 1),
        volume_Density=4.0,
    )
    found, notes = read_material(material)
    assert (found.transmission, found.ior, found.roughness) == (0.75, 1.25, 0.0)
    assert found.absorption == (0, 2, 3)
    assert notes == []


def test_principled_volumes_absorb_what_they_do_not_scatter_and_do_not_keep(read_material):
    material = add_material(
        volume="ShaderNodeVolumePrincipled",
        volume_Color=(0.5, 0.25, 1, 1),
        volume_Absorption_Color=(0, 0.25, 0, 1),
        volume_Density=2.0,
    )
    assert read_material(material)[0].absorption == pytest.approx((1, 0.75, 0))


def test_glass_has_its_colour_at_each_surface(read_material):
    found, _ = read_material(add_material("ShaderNodeBsdfGlass", Color=(0.5, 1, 1, 1), IOR=1.4, Roughness=0.0))
    assert (found.color, found.transmission, found.ior) == ((0.25, 1, 1), 1, pytest.approx(1.4))


def test_a_volume_alone_bends_no_light(read_material):
    found, _ = read_material(add_material(None, "ShaderNodeVolumeAbsorption", volume_Color=(0, 1, 1, 1)))
    assert (found.transmission, found.ior, found.absorption) == (1, 1, (1, 0, 0))


def test_constants_are_followed_and_textures_are_said(empty_scene, read_material):
    material = add_material(Roughness=0.1)
    tree, principled = material.node_tree, material.node_tree.nodes["Principled BSDF"]
    color, relay = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("NodeReroute")
    color.outputs[0].default_value = (0.25, 0.5, 0.75, 1)
    tree.links.new(color.outputs[0], relay.inputs[0])
    tree.links.new(relay.outputs[0], principled.inputs["Base Color"])
    found, notes = read_material(material)
    assert (found.color, notes) == ((0.25, 0.5, 0.75), [])
    material.diffuse_color = (1, 0, 0, 1)
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], principled.inputs["Base Color"])
    found, notes = read_material(material)
    assert found.color == (1, 0, 0)
    assert notes == ["'Liquid' is shown with the colours of its viewport display, because nodes are linked to its Base Color"]
    assert "its surface is made by the node" in read_material(add_material("ShaderNodeBsdfHair"))[1][0]


def test_fluid_without_a_material_is_as_clear_as_the_scene_says(empty_scene, module):
    add_points(empty_scene.collection)
    settings = empty_scene.meniscus
    settings.color, settings.transmission, settings.absorption, settings.ior = (0, 0.5, 1), 0.5, 4.0, 1.25
    read = module("read_scene").read_parts
    (source,) = read(bpy.context.evaluated_depsgraph_get(), uses_materials=True).sources
    assert source.material.color == (0.5, 0.75, 1)
    assert source.material.absorption == (4, 2, 0)
    assert (source.material.transmission, source.material.ior) == (0.5, 1.25)


def test_tracing_is_that_of_the_scene_but_for_choices(empty_scene, module):
    read, settings = module("read_scene").read_tracing, empty_scene.meniscus
    assert read(empty_scene, {}) is None
    settings.use_tracing, settings.tracing_reflections, settings.use_tracing_shadows = True, 5, False
    settings.tracing_occlusion_rays = 9
    found = read(empty_scene, {"reflections": None, "samples": 3})
    assert (found.reflections, found.shadows, found.samples, found.occlusion_rays) == (5, False, 3, 0)
    assert np.isinf(found.occlusion_distance)
    settings.use_tracing_occlusion, settings.tracing_occlusion_distance = True, 0.5
    assert (read(empty_scene, {}).occlusion_rays, read(empty_scene, {}).occlusion_distance) == (9, 0.5)
    assert read(empty_scene, {"use_tracing": False}) is None
