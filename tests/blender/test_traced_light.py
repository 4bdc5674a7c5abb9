"""Traced light in renders: what stands in the way of a light, what is mirrored, what is seen through a liquid."""

import importlib
from pathlib import Path

import bpy
import numpy as np
import pytest
from cycles_depth import passes_of_render, set_up_cycles
from fluid_scenes import add_object, add_points
from test_read_light import add_environment, add_image, add_light, add_material
from test_scene_meshes import add_mesh

SIZE = 64


@pytest.fixture
def scene(empty_scene):
    """A ball of fluid of the radius 1 at the origin, seen from the front by an orthographic camera that shows 4 x 4 units."""
    add_points(empty_scene.collection, "Fluid", [(0, 0, 0)], 1 / np.sqrt(0.5))
    settings = empty_scene.meniscus
    settings.kernel, settings.isovalue, settings.render_samples = "quartic", 0.25, 1
    settings.use_tracing = True
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -10, 0), (np.pi / 2, 0, 0)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    empty_scene.camera = camera
    render = empty_scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = SIZE, SIZE, 100
    set_up_cycles(empty_scene)
    return empty_scene


@pytest.fixture
def render(scene, tmp_path):
    """Gives the colours of a render, (height, width, 3), row 0 at the bottom."""

    def by(engine="MENISCUS"):
        scene.render.engine = engine
        passes = passes_of_render(scene, Path(tmp_path) / f"{engine}.exr")[0]
        return np.stack([passes[f"ViewLayer.Combined.{channel}"] for channel in "RGB"], axis=2)

    return by


def use_material(scene, **inputs):
    scene.objects["Fluid"].data.materials.clear()
    scene.objects["Fluid"].data.materials.append(add_material(**inputs))


def add_plane(scene, name, location, rotation=(0, 0, 0), size=2.0, **inputs):
    plane = add_mesh(scene.collection, lambda: bpy.ops.mesh.primitive_plane_add(size=size), name)
    plane.location, plane.rotation_euler = location, rotation
    plane.data.materials.append(add_material(**inputs))
    return plane


DULL = {"Base_Color": (0.8, 0.8, 0.8, 1), "Roughness": 1.0, "IOR": 1.0}
LUMINOUS = {"Base_Color": (0, 0, 0, 1), "IOR": 1.0, "Roughness": 1.0, "Emission_Color": (0, 1, 0, 1), "Emission_Strength": 1.0}


def test_fluid_casts_a_shadow_on_what_is_behind_it(scene, render):
    """A sun from the right; a wall that is seen from the front, and the shadow that a ball of the radius 1 has on it."""
    use_material(scene, **DULL)
    add_plane(scene, "Wall", (0, 2, 0), (np.pi / 2, 0, 0), 4.0, **DULL)
    sun = add_light(scene, "SUN", energy=np.pi, angle=0.0)
    sun.rotation_euler = (np.pi / 2, 0, np.pi / 4)  # towards -x and +y
    lit = render()
    x = (np.arange(SIZE) + 0.5) / SIZE * 4 - 2

    def at(place):
        """Its pixel."""
        return int((place + 2) / 4 * SIZE)

    row = lit[at(0.0)]
    assert row[at(-1.6), 0] < 0.01
    assert row[at(1.6), 0] == pytest.approx(0.8 * np.sqrt(0.5), rel=0.02)
    # The axis of the shadow meets the wall at x = -2; it is an ellipse of the half axes sqrt(2) and 1.
    shadow = (row[:, 0] < 0.01) & (np.abs(x) > 1)
    assert x[shadow].max() < -1 + 4 / SIZE
    column = lit[:, at(-1.6), 0] < 0.01
    height = np.sqrt(1 - (0.4 / np.sqrt(2)) ** 2)
    assert np.count_nonzero(column) / SIZE * 4 == pytest.approx(2 * height, abs=0.13)
    scene.meniscus.use_tracing_shadows = False
    assert render()[at(0.0), at(-1.6), 0] == pytest.approx(0.8 * np.sqrt(0.5), rel=0.02)
    scene.meniscus.use_tracing_shadows, sun.data.use_shadow = True, False
    assert render()[at(0.0), at(-1.6), 0] == pytest.approx(0.8 * np.sqrt(0.5), rel=0.02)


def test_a_mirror_shows_what_no_camera_sees(scene, render):
    """A green plane behind the camera, and only where its rays count."""
    use_material(scene, Base_Color=(1, 1, 1, 1), Metallic=1.0, Roughness=0.0)
    plane = add_plane(scene, "Light", (0, -5, 0), (-np.pi / 2, 0, 0), 20.0, **LUMINOUS)
    plane.visible_camera = False
    middle = slice(SIZE // 2 - 3, SIZE // 2 + 3)
    np.testing.assert_allclose(render()[middle, middle].mean(axis=(0, 1)), (0, 1, 0), atol=0.01)
    scene.meniscus.tracing_reflections = 0
    assert render()[middle, middle].max() < 0.01
    scene.meniscus.tracing_reflections = 1
    plane.visible_glossy = plane.visible_transmission = False
    assert render()[middle, middle].max() < 0.01


def test_clear_fluid_shows_what_is_behind_it_upside_down(scene, render):
    use_material(
        scene,
        Base_Color=(1, 1, 1, 1),
        Transmission_Weight=1.0,
        Roughness=0.0,
        IOR=1.5,
        volume="ShaderNodeVolumeAbsorption",
        volume_Color=(1, 0, 1, 1),
        volume_Density=0.25,
    )
    add_plane(scene, "Upper", (0, 8, 10), (np.pi / 2, 0, 0), 20.0, **LUMINOUS)
    above, below = slice(SIZE // 2 + 2, SIZE // 2 + 10), slice(SIZE // 2 - 10, SIZE // 2 - 1)
    seen = render()[..., 1]
    assert seen[above, SIZE // 2].max() < 0.1
    assert seen[below, SIZE // 2].min() > 0.3
    # Near the axis light has 2 units to go, and loses 4 % at each of two surfaces.
    assert seen[SIZE // 2 - 2, SIZE // 2] == pytest.approx(0.96**2 * np.exp(-0.5), rel=0.03)
    scene.meniscus.use_tracing = False
    straight = render()[..., 1]
    assert straight[above, SIZE // 2].min() > 0.3
    assert straight[below, SIZE // 2].max() < 0.1


def test_clear_fluid_and_the_world_are_those_of_cycles(scene, render):
    """A sphere of glass and its mesh before an image that is turned by a Mapping node."""
    use_material(scene, Base_Color=(1, 1, 1, 1), Transmission_Weight=1.0, Roughness=0.0, IOR=1.33)
    sphere = add_mesh(
        scene.collection, lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128), "Sphere", smooth=True
    )
    sphere.data.materials.append(scene.objects["Fluid"].data.materials[0])
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    u, v = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32)
    waves = np.stack([0.5 + 0.4 * np.cos(2 * np.pi * u), v, 0.5 + 0.4 * np.sin(2 * np.pi * u)], axis=2)
    add_environment(scene.world, add_image(waves.astype(np.float32)), Rotation=(0.4, -0.3, 0.8))
    scene.camera.data.type, scene.camera.data.angle = "PERSP", 0.5
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.transmission_bounces = 64, 12, 12
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.objects["Fluid"].hide_render = True
    expected = render("CYCLES")
    scene.objects["Fluid"].hide_render, sphere.hide_render = False, True
    actual = render()
    assert np.ptp(expected) > 0.4
    corners = np.abs(actual - expected)[:8, :8]
    assert corners.max() < 0.02
    assert np.abs(actual - expected).mean() < 0.02 * expected.mean()


def test_what_cannot_be_read_is_said_by_the_render(scene, meniscus):
    material = add_material(**DULL)
    tree = material.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    scene.objects["Fluid"].data.materials.append(material)
    module = importlib.import_module(f"{meniscus.__name__}.addon.blender.render_scene")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    read = module.read_view_layer(depsgraph, module.RenderSettings(("combined",)), lambda *_: None)
    image = read.image(module.Control(lambda: False))
    assert [note.split(",")[0] for note in image.info.notes] == [
        f"'{material.name}' is shown with the colours of its viewport display"
    ]
