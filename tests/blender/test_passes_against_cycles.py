"""Passes are those of Cycles: names, channels, spaces, signs and backgrounds, on spheres that both render."""

import json

import bmesh
import bpy
import numpy as np
import pytest
from cycles_depth import passes_of_render, set_up_cycles
from fluid_scenes import add_object, add_points, store
from mathutils import Matrix

RADIUS = 0.7
CENTRES = np.array([(-0.9, 0.3, 0.1), (0.8, -0.2, 0.4), (0.1, 1.5, -0.9)], np.float32)
VELOCITY = np.array((1.2, -0.8, 0.5), np.float32)
"""Of all spheres, Blender units a frame / 10."""

SWITCHES = ("z", "normal", "position", "vector", "object_index", "cryptomatte_object")


def add_spheres(scene, centres):
    """A mesh: Cycles has the motion of points' centres only, not of what is seen of them."""
    mesh, spheres = bpy.data.meshes.new("Spheres"), bmesh.new()
    for centre in centres:
        bmesh.ops.create_icosphere(spheres, subdivisions=6, radius=RADIUS, matrix=Matrix.Translation(centre))
    for face in spheres.faces:
        face.smooth = True
    spheres.to_mesh(mesh)
    return add_object(scene.collection, "Spheres", mesh)


@pytest.fixture
def centres(request):
    """Of the spheres; tests may ask for others."""
    return getattr(request, "param", CENTRES)


@pytest.fixture
def scene(empty_scene, centres):
    """Balls that look like spheres, the spheres themselves, and a camera, all moving."""
    fluid = add_points(empty_scene.collection, "Fluid", centres, RADIUS / np.sqrt(0.5))
    empty_scene.meniscus.kernel, empty_scene.meniscus.isovalue = "quartic", 0.25
    store(fluid.data, "velocity", "FLOAT_VECTOR", "vector", np.tile(VELOCITY * 2.4, (len(centres), 1)))
    spheres = add_spheres(empty_scene, centres)
    for frame in (4, 6):
        spheres.location = (frame - 5) * VELOCITY / 10
        spheres.keyframe_insert("location", frame=frame)
    _make_linear(spheres)
    fluid.pass_index = spheres.pass_index = 7
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.rotation_euler = (1.4, 0.05, 0.1)
    for frame, x in ((4, 0.3), (5, 0.4), (6, 0.8)):  # faster and faster, so that before and after differ
        camera.location = (x, -6, 1.2 - (frame - 5) * 0.05)
        camera.keyframe_insert("location", frame=frame)
    _make_linear(camera)
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    empty_scene.frame_set(5)
    empty_scene.render.resolution_x, empty_scene.render.resolution_y, empty_scene.render.resolution_percentage = 96, 72, 100
    empty_scene.render.film_transparent, empty_scene.meniscus.render_samples = True, 1
    set_up_cycles(empty_scene)
    for name in SWITCHES:
        setattr(empty_scene.view_layers[0], f"use_pass_{name}", True)
    return empty_scene


def _make_linear(item):
    """Motion that is the same before and after."""
    action = item.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


@pytest.fixture
def render(scene, tmp_path):
    """Gives the passes and the header of a render by one of the engines."""

    def by(engine):
        scene.render.engine = engine
        scene.objects["Fluid"].hide_render = engine == "CYCLES"
        scene.objects["Spheres"].hide_render = engine != "CYCLES"
        return passes_of_render(scene, tmp_path / f"{engine}.exr")

    return by


def test_data_passes(scene, render):
    (expected, _), (actual, _) = render("CYCLES"), render("MENISCUS")
    names = {name for name in expected if "Noisy" not in name}
    assert set(actual) == names
    hit = actual["ViewLayer.Depth.Z"] < 1e9
    inner = np.all([np.roll(hit, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0)
    outer = ~np.any([np.roll(hit, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0)
    assert inner.mean() > 0.1
    tolerances = {"Depth": 1e-3, "Normal": 5e-3, "Position": 5e-3, "Vector": 0.05, "IndexOB": 0, "Object Index": 0}
    for name in sorted(names):
        kind = name.split(".")[1]
        if kind in tolerances:
            differences = np.abs(actual[name] - expected[name])
            assert np.quantile(differences[inner], 0.98) <= tolerances[kind], name
            np.testing.assert_allclose(actual[name][outer], expected[name][outer], atol=1e-4, err_msg=name)
    assert np.abs(expected["ViewLayer.Vector.Y"][inner]).min() > 1, "the spheres should move"
    assert np.abs(expected["ViewLayer.Vector.X"] - expected["ViewLayer.Vector.Z"])[inner].min() > 1


@pytest.mark.parametrize("own", [None, 0.25], ids=["positions", "velocities of a moving object"])
def test_vectors_of_fluid_that_its_object_moves(scene, render, own):
    """Points without velocities, and such whose velocities are a part of the motion, as Cycles adds both."""
    fluid = scene.objects["Fluid"]
    if own is None:
        fluid.data.attributes.remove(fluid.data.attributes["velocity"])
    else:
        fluid.data.attributes["velocity"].data.foreach_set("vector", np.tile(VELOCITY * 2.4 * own, len(CENTRES)))
    for frame in (4, 6):
        fluid.location = (frame - 5) * VELOCITY / 10 * (1 - (own or 0))
        fluid.keyframe_insert("location", frame=frame)
    _make_linear(fluid)
    (expected, _), (actual, _) = render("CYCLES"), render("MENISCUS")
    hit = actual["ViewLayer.Depth.Z"] < 1e9
    inner = np.all([np.roll(hit, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0)
    for channel in "XYZW":
        name = f"ViewLayer.Vector.{channel}"
        assert np.quantile(np.abs(actual[name] - expected[name])[inner], 0.98) <= 0.05, name
    assert np.abs(expected["ViewLayer.Vector.Y"][inner]).min() > 1


def test_cryptomatte(scene, render):
    (expected, cycles), (actual, header) = render("CYCLES"), render("MENISCUS")
    manifests = []
    for found in (cycles, header):
        (key,) = [key for key in found if key.startswith("cryptomatte/") and key.endswith("/name")]
        start = key.removesuffix("name")
        assert (found[key], found[start + "hash"]) == ("ViewLayer.CryptoObject", "MurmurHash3_32")
        assert found[start + "conversion"] == "uint32_to_float32"
        manifests.append((start, json.loads(found[start + "manifest"])))
    assert manifests[0][0] == manifests[1][0]
    for passes, (_, manifest), name in ((expected, manifests[0], "Spheres"), (actual, manifests[1], "Fluid")):
        number = np.array([int(manifest[name], 16)], np.uint32).view(np.float32)[0]
        first = passes["ViewLayer.CryptoObject00.r"]
        assert set(np.unique(first)) == {0, number}
    for channel in ("00.g", "00.a", "01.g", "02.r"):
        name = f"ViewLayer.CryptoObject{channel}"
        differences = np.abs(actual[name] - expected[name])
        assert (differences > 0.01).mean() < 0.02, name


def _material(**values):
    material = bpy.data.materials.new("Material")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    for name, value in values.items():
        inputs[name.replace("_", " ")].default_value = value
    return material


def _add_light(scene, kind, **settings):
    light = bpy.data.lights.new(kind, kind)
    for name, value in settings.items():
        setattr(light, name, value)
    item = bpy.data.objects.new(kind, light)
    item.location, item.rotation_euler = (2.5, -3.0, 4.0), (0.75, 0.2, 0.6)
    scene.collection.objects.link(item)


LIGHTS = {
    "sun": lambda scene: _add_light(scene, "SUN", energy=3.0, angle=0.0, color=(1, 0.8, 0.5)),
    "point": lambda scene: _add_light(scene, "POINT", energy=900.0, shadow_soft_size=0.0),
    "spot": lambda scene: _add_light(scene, "SPOT", energy=900.0, shadow_soft_size=0.0, spot_size=0.35, spot_blend=0.5),
    "area": lambda scene: _add_light(scene, "AREA", energy=500.0, size=0.4),
    "world": lambda scene: None,
}


@pytest.mark.parametrize("centres", [CENTRES[1:2]], indirect=True, ids=[""])
@pytest.mark.parametrize("light", LIGHTS)
def test_dull_materials_in_each_light(scene, render, light):
    """Without gloss the formulas are exact, but for shadows."""
    material = _material(Base_Color=(0.8, 0.5, 0.2, 1), Roughness=1.0, IOR=1.0)
    for name in ("Fluid", "Spheres"):
        scene.objects[name].data.materials.append(material)
    LIGHTS[light](scene)
    if light == "world":
        scene.world = bpy.data.worlds.new("World")
        scene.world.use_nodes = True
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.4, 1.0, 1)
    scene.cycles.samples, scene.cycles.max_bounces = 64, 0
    (expected, _), (actual, _) = render("CYCLES"), render("MENISCUS")
    hit = expected["ViewLayer.Combined.A"] == 1
    for channel in "RGB":
        mine, theirs = actual[f"ViewLayer.Combined.{channel}"][hit], expected[f"ViewLayer.Combined.{channel}"][hit]
        assert mine.max() > 0.05
        assert np.median(np.abs(mine - theirs)) < 0.02 * theirs.max()
        assert mine.mean() == pytest.approx(theirs.mean(), rel=0.06)
