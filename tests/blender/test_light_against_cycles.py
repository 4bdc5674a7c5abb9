"""Traced light is that of Cycles, on a sphere that both render with the same material, lights and world."""

import importlib

import bmesh
import bpy
import numpy as np
import pytest
from cycles_depth import passes_of_render, set_up_cycles
from fluid_scenes import add_object
from mathutils import Vector

RADIUS = 0.7
SAMPLES = 128
GOLD = (0.9, 0.6, 0.2)
SUN = {"kind": "SUN", "power": (3.0, 2.5, 2.0), "direction": (0.48, 0.6, -0.64), "radius": 0.1}
POINT = {"kind": "POINT", "power": (150.0, 120.0, 90.0), "position": (-1.5, -2.0, 1.5), "radius": 0.4}
SPOT = {**POINT, "kind": "SPOT", "direction": (0.6, 0.64, -0.48), "cone": (np.cos(0.45), 0.5), "radius": 0.0}
AREA = {
    "kind": "AREA",
    "power": (60.0, 80.0, 100.0),
    "position": (0.0, -1.6, 1.2),
    "direction": (0.0, 0.8, -0.6),
    "size": (1.5, 0.8),
}

# The material, the lights, and whether the world is an image.
CASES = {
    "tinted glass": ({"color": GOLD, "transmission": 1.0, "roughness": 0.0, "ior": 1.33}, [POINT], True),
    "mirror": ({"color": GOLD, "metallic": 1.0, "roughness": 0.0}, [AREA], True),
    "rough metal": ({"color": GOLD, "metallic": 1.0, "roughness": 0.5}, [], True),
    "matt": ({"color": GOLD, "roughness": 1.0, "ior": 1.0}, [POINT, AREA, SUN, SPOT], True),
    "rough plastic": ({"color": GOLD, "roughness": 0.4, "ior": 1.5}, [SUN, AREA], True),
}
BOUND = 0.02
"""Of the mean error, as a share of the mean light."""

# Older ones weigh rough surfaces otherwise.
pytestmark = pytest.mark.skipif(bpy.app.version < (5, 2), reason="one version of Cycles is enough")


@pytest.fixture
def scene(empty_scene):
    """A sphere as a mesh, and a camera."""
    mesh, sphere = bpy.data.meshes.new("Sphere"), bmesh.new()
    bmesh.ops.create_icosphere(sphere, subdivisions=6, radius=RADIUS)
    for face in sphere.faces:
        face.smooth = True
    sphere.to_mesh(mesh)
    add_object(empty_scene.collection, "Sphere", mesh)
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.data.lens = (0, -4, 0.8), (1.37, 0, 0), 90
    empty_scene.camera = camera
    render = empty_scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 36, 100
    set_up_cycles(empty_scene)
    cycles = empty_scene.cycles
    cycles.samples, cycles.blur_glossy, cycles.sample_clamp_indirect, cycles.max_bounces = SAMPLES, 0, 0, 16
    cycles.transmission_bounces = cycles.glossy_bounces = 16
    # Matt surfaces send one another nothing.
    cycles.diffuse_bounces = 0
    return empty_scene


def world_pixels():
    """(64, 128, 3): a bright side, a dark one and a band."""
    v, u = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    angle = 2 * np.pi * u
    return np.stack([0.6 + 0.5 * np.cos(angle), 0.2 + 0.8 * v, 0.6 + 0.4 * np.sin(2 * angle)], axis=-1).astype(np.float32)


def set_material(item, values):
    material = bpy.data.materials.new("Material")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    inputs = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED").inputs
    names = {"metallic": "Metallic", "roughness": "Roughness", "ior": "IOR", "transmission": "Transmission Weight"}
    inputs["Base Color"].default_value = (*values.get("color", (1, 1, 1)), 1)
    for name, entry in names.items():
        if name in values:
            inputs[entry].default_value = values[name]
    item.data.materials.append(material)


def add_light(scene, kind, power, position=(0, 0, 0), direction=(0, 0, -1), radius=0.0, cone=None, size=None):
    data = bpy.data.lights.new("Light", kind)
    data.energy, data.color = max(power), [channel / max(power) for channel in power]
    if kind == "SUN":
        data.angle = 2 * radius
    elif kind == "AREA":
        data.shape, (data.size, data.size_y) = "RECTANGLE", size
    else:
        data.shadow_soft_size = radius
    if cone:
        data.spot_size, data.spot_blend = 2 * np.arccos(cone[0]), cone[1]
    item = add_object(scene.collection, "Light", data)
    item.rotation_euler, item.location = Vector(direction).to_track_quat("-Z", "Y").to_euler(), position
    bpy.context.view_layer.update()
    # Along its width.
    return tuple(item.matrix_world.to_3x3().col[0])


def set_world(scene, is_image):
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    if is_image:
        pixels = world_pixels()
        image = bpy.data.images.new("World", pixels.shape[1], pixels.shape[0], float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1).ravel())
        image.pack()
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = image
        tree.links.new(node.outputs[0], background.inputs["Color"])


def part(meniscus, name):
    return importlib.import_module(f"{meniscus.__name__}.addon.{name}")


@pytest.mark.parametrize("case", CASES)
def test_light(meniscus, scene, tmp_path, case):
    values, lights, is_image = CASES[case]
    lighting = part(meniscus, "fluid.lighting")
    tracing = part(meniscus, "fluid.tracing").Tracing(reflections=16, refractions=16, samples=SAMPLES)
    set_material(bpy.data.objects["Sphere"], values)
    set_world(scene, is_image)
    ours = []
    for light in lights:
        right = add_light(scene, **light)
        ours.append(lighting.Light(**light, right=right))
    passes, _ = passes_of_render(scene, tmp_path / "cycles.exr")
    expected = np.stack([passes[f"ViewLayer.Combined.{channel}"] for channel in "RGB"], axis=-1)

    material = lighting.Material(**{"color": (1.0, 1.0, 1.0), **values})
    world = lighting.WorldImage(world_pixels()) if is_image else None
    look = meniscus.Look(
        "material",
        color=material.color,
        sources=(lighting.FluidSource(material=material),),
        lighting=lighting.Lighting(tuple(ours), (0.0, 0.0, 0.0), world),
        tracing=tracing,
    )
    camera = part(meniscus, "blender.read_camera").read_camera(bpy.context.evaluated_depsgraph_get())
    backdrop = part(meniscus, "render.surroundings").Backdrop.empty(camera, (0.0, 0.0, 0.0, 1.0))
    balls = meniscus.Balls([[0.0, 0.0, 0.0]], RADIUS / np.sqrt(0.5))
    image = meniscus.render(
        balls,
        camera,
        meniscus.Field("quartic", 0.25),
        passes=("combined", "depth"),
        look=look,
        backend="cpu",
        backdrop=backdrop,
    )
    hit = (image["depth"] < 1e9) & (passes["ViewLayer.Depth.Z"] < 1e9)
    actual, expected = image["combined"][..., :3][hit], expected[hit]
    assert hit.mean() > 0.2
    error = np.abs(actual - expected).mean() / expected.mean()
    assert error < BOUND, f"mean {actual.mean(axis=0)}, not {expected.mean(axis=0)}"
