"""The meshes of a scene as arrays: what a render shows, where, with which normals and materials."""

import importlib

import bpy
import numpy as np
import pytest
from fluid_scenes import add_emitter, add_geometry_nodes, add_object, add_points, input_error, instance_collection
from mathutils import Matrix

CORNERS = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 2, 0.5), (0, 1, 0), (0, 0, 3), (2, 0, 3)]
FACES = [(0, 1, 2, 3, 4), (0, 5, 6, 1), (5, 0, 4)]
"""A pentagon, a quadrilateral and a triangle: six triangles."""


def read(meniscus, depsgraph=None):
    reader = importlib.import_module(meniscus.__name__ + ".addon.blender.read_meshes")
    return reader.read_meshes(depsgraph or bpy.context.evaluated_depsgraph_get())


def add_faces(collection, name="Faces", faces=FACES):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(CORNERS, [], faces)
    return add_object(collection, name, mesh)


@pytest.fixture
def collection(empty_scene):
    made = bpy.data.collections.new("Things")
    empty_scene.collection.children.link(made)
    return made


def layer_collection():
    return bpy.context.view_layer.layer_collection.children["Things"]


def principled(material):
    """The node that a new material has for its surface."""
    if bpy.app.version < (5, 0):  # since then there are nodes always
        material.use_nodes = True
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def seen(meniscus):
    """How many triangles each object shows, by its name."""
    meshes = read(meniscus)
    counts = np.bincount(meshes.object, minlength=len(meshes.objects))
    return {item.name: int(count) for item, count in zip(meshes.objects, counts, strict=True)}


@pytest.mark.parametrize("faces", [FACES, [(0, 1, 2), (0, 5, 6)]])
@pytest.mark.parametrize("is_smooth", [False, True])
def test_corners_normals_and_materials_are_those_of_blender(meniscus, collection, faces, is_smooth):
    item = add_faces(collection, faces=faces)
    item.matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.7, 4, (1, 2, 3)) @ Matrix.Diagonal((2, 0.5, 1, 1))
    for number, polygon in enumerate(item.data.polygons):
        material = bpy.data.materials.new(f"Material {number}")
        item.data.materials.append(material)
        polygon.material_index, polygon.use_smooth = number, is_smooth
        node = principled(material)
        node.inputs["Base Color"].default_value = (0.5, number / 4, 0.125, 1)
        node.inputs["Roughness"].default_value = 0.75
    meshes = read(meniscus)
    mesh, turn = item.data, np.linalg.inv(np.array(item.matrix_world)[:3, :3]).T
    mesh.calc_loop_triangles()
    assert len(meshes) == len(mesh.loop_triangles)
    for index, triangle in enumerate(mesh.loop_triangles):
        corners = [item.matrix_world @ mesh.vertices[vertex].co for vertex in triangle.vertices]
        np.testing.assert_allclose(meshes.vertices[meshes.triangles[index]], corners, atol=1e-5)
        normals = np.array([mesh.corner_normals[loop].vector for loop in triangle.loops]) @ turn.T
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        np.testing.assert_allclose(meshes.normals[index], normals, atol=1e-5)
        material = meshes.materials[meshes.material[index]]
        np.testing.assert_allclose(material.color, (0.5, mesh.polygons[triangle.polygon_index].material_index / 4, 0.125))
        assert material.roughness == 0.75


def test_a_mesh_in_edit_mode_is_seen_as_it_will_be_afterwards(meniscus, collection):
    item = add_faces(collection)
    item.location = (1, 0, 0)
    item.modifiers.new("Array", "ARRAY").count = 2
    bpy.context.view_layer.objects.active = item
    expected = read(meniscus)
    bpy.ops.object.mode_set(mode="EDIT")
    edited = read(meniscus)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(edited) == len(expected) == 12
    np.testing.assert_allclose(edited.vertices[edited.triangles], expected.vertices[expected.triangles], atol=1e-6)


def hide_object(item):
    item.hide_render = True


def hide_collection(_item):
    layer_collection().collection.hide_render = True


def exclude(_item):
    layer_collection().exclude = True


def show_indirectly_only(_item):
    layer_collection().indirect_only = True


def hide_from_camera(item):
    item.visible_camera = False


def instance_on_vertices_without_itself(item):
    item.instance_type, item.show_instancer_for_render = "VERTS", False


def instance_on_vertices_without_itself_in_the_viewport_either(item):
    item.instance_type, item.show_instancer_for_render, item.show_instancer_for_viewport = "VERTS", False, False


@pytest.mark.parametrize(
    "hide",
    [
        hide_object,
        hide_collection,
        exclude,
        show_indirectly_only,
        hide_from_camera,
        instance_on_vertices_without_itself,
        instance_on_vertices_without_itself_in_the_viewport_either,
    ],
)
def test_what_a_render_does_not_show_is_not_read(meniscus, collection, empty_scene, hide):
    item = add_faces(collection)
    add_faces(empty_scene.collection, "Other")
    assert seen(meniscus) == {"Faces": 6, "Other": 6}
    hide(item)
    assert seen(meniscus) == {"Other": 6}


def instance_on_vertices_with_itself_in_renders(item):
    item.instance_type, item.show_instancer_for_viewport = "VERTS", False


@pytest.mark.parametrize("hide", [lambda item: item.hide_set(True), instance_on_vertices_with_itself_in_renders])
def test_what_the_viewport_alone_hides_is_an_error(meniscus, collection, hide):
    """Fluid would not be hidden where it must be. What a render does not show either does not matter."""
    item = add_faces(collection)
    hide(item)
    with pytest.raises(input_error(meniscus), match="'Faces' is hidden in the viewport only"):
        read(meniscus)
    item.hide_render = True
    assert seen(meniscus) == {}


def test_instances_that_the_viewport_alone_hides_are_an_error(meniscus, collection, empty_scene):
    group = bpy.data.collections.new("Group")
    add_faces(group)
    instancer = instance_collection(empty_scene, group)
    instancer.show_instancer_for_viewport = False
    assert seen(meniscus) == {"Faces": 6}
    instancer.hide_set(True)
    with pytest.raises(input_error(meniscus), match="'Instance' is hidden in the viewport only"):
        read(meniscus)


@pytest.mark.parametrize("how", ["object", "collection", "instance"])
def test_holdouts_are_known(meniscus, collection, empty_scene, how):
    group = bpy.data.collections.new("Group")
    add_faces(group if how == "instance" else collection)
    if how == "instance":
        instancer = instance_collection(empty_scene, group)
        empty_scene.collection.objects.unlink(instancer)
        collection.objects.link(instancer)
    add_faces(empty_scene.collection, "Other")
    if how == "object":
        bpy.data.objects["Faces"].is_holdout = True
    else:
        layer_collection().holdout = True
    assert {item.name: item.is_holdout for item in read(meniscus).objects} == {"Faces": True, "Other": False}


def test_instances_stand_where_they_are(meniscus, collection, empty_scene):
    """Of a collection with a mesh and a curve, whose own objects are in no view layer."""
    group = bpy.data.collections.new("Group")
    add_faces(group).pass_index = 7
    curve = bpy.data.curves.new("Curve", "CURVE")
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (0, 0, 1, 1)
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.1, 0
    add_object(group, "Curve", curve)
    instance_collection(empty_scene, group, "First", location=(10, 0, 0))
    once = seen(meniscus)
    assert once["Faces"] == 6
    assert once["Curve"] > 4
    instance_collection(empty_scene, group, "Second", location=(-10, 0, 0), scale=(2, 2, 2))
    assert seen(meniscus) == {name: 2 * count for name, count in once.items()}
    meshes = read(meniscus)
    faces = next(index for index, item in enumerate(meshes.objects) if item.name == "Faces")
    assert meshes.objects[faces].pass_index == 7
    places = meshes.vertices[meshes.triangles[meshes.object == faces]].reshape(-1, 3)
    np.testing.assert_allclose((places.min(axis=0), places.max(axis=0)), ((-10, 0, 0), (12, 4, 6)), atol=1e-5)


def test_what_geometry_nodes_make_is_read(meniscus, collection):
    """A cube on each vertex, with the material that a node gives it."""
    item = add_faces(collection)
    group, (points,) = add_geometry_nodes(item, "GeometryNodeInstanceOnPoints")
    cube, paint = group.nodes.new("GeometryNodeMeshCube"), group.nodes.new("GeometryNodeSetMaterial")
    material = bpy.data.materials.new("Paint")
    principled(material).inputs["Metallic"].default_value = 0.625
    paint.inputs["Material"].default_value = material
    group.links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
    group.links.new(paint.outputs["Geometry"], points.inputs["Instance"])
    meshes = read(meniscus)
    assert len(meshes) == 12 * len(CORNERS)
    middles = meshes.vertices[meshes.triangles].reshape(len(CORNERS), -1, 3).mean(axis=1)
    np.testing.assert_allclose(np.sort(middles, axis=0), np.sort(CORNERS, axis=0), atol=1e-5)
    assert {meshes.materials[index].metallic for index in meshes.material} == {0.625}


def test_the_view_layer_s_material_override_counts(meniscus, collection):
    item = add_faces(collection)
    item.data.materials.append(bpy.data.materials.new("Own"))
    override = bpy.data.materials.new("Override")
    bpy.context.view_layer.material_override = override
    principled(override).inputs["Metallic"].default_value = 0.375
    assert [material.metallic for material in read(meniscus).materials] == [0.375]


def test_fluids_show_the_emitter_only(meniscus, collection):
    add_points(collection, "Points")
    emitter = add_emitter(collection)
    drawn = add_faces(collection, "Drawn")
    settings = emitter.particle_systems[0].settings
    settings.render_type, settings.instance_object = "OBJECT", drawn
    bpy.context.scene.frame_set(2)
    assert seen(meniscus) == {"Emitter": 2, "Drawn": 6}
    emitter.show_instancer_for_render = False
    assert seen(meniscus) == {"Drawn": 6}
    emitter.meniscus.use_fluid = False
    assert seen(meniscus)["Drawn"] > 6
