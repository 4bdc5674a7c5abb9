"""Small fluid sources for tests, and how to read them."""

import importlib

import bpy
import numpy as np

GRID_POINTS = np.array([(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 3)], np.float32)


def read_balls(meniscus, **options):
    """The balls of the current scene, through the dependency graph that the viewport uses."""
    reader = importlib.import_module(meniscus.__name__ + ".addon.blender.read_scene")
    return reader.read_fluid(bpy.context.evaluated_depsgraph_get(), **options).balls


def input_error(meniscus):
    """The class of the errors that a user can mend."""
    return importlib.import_module(meniscus.__name__ + ".addon.fluid.errors").InputError


def add_object(collection, name, data):
    """A new object in a collection."""
    item = bpy.data.objects.new(name, data)
    collection.objects.link(item)
    return item


def add_points(collection, name="Points", points=GRID_POINTS, radius=0.5):
    """A fluid of mesh vertices with one radius, given as an attribute and read as it is."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points).tolist(), [], [])
    store(mesh, "radius", "FLOAT", "value", np.full(len(points), radius, np.float32))
    item = add_object(collection, name, mesh)
    item.meniscus.use_fluid = True
    item.meniscus.radius_factor = 1.0
    return item


def store(data, name, data_type, value, values, domain="POINT"):
    """Put an attribute on a mesh."""
    attribute = data.attributes.new(name, data_type, domain)
    attribute.data.foreach_set(value, np.ravel(values))


def add_emitter(collection, name="Emitter", **settings):
    """A fluid of particles that fly up at 1 m/s from a square, born at frame 1."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    item = add_object(collection, name, mesh)
    add_particle_system(item, **settings)
    item.meniscus.use_fluid = True
    item.meniscus.radius_factor = 1.0
    return item


def add_particle_system(item, **settings):
    """One more particle system on an object; `settings` replace those of its ParticleSettings."""
    modifier = item.modifiers.new("Particles", "PARTICLE_SYSTEM")
    chosen = modifier.particle_system.settings
    chosen.effector_weights.gravity = 0
    defaults = {"count": 50, "frame_start": 1, "frame_end": 1, "lifetime": 100, "particle_size": 0.1, "normal_factor": 1}
    for name, value in (defaults | settings).items():
        setattr(chosen, name, value)
    return modifier


def play(scene, last_frame):
    """Simulate from the first frame to `last_frame`."""
    for frame in range(1, last_frame + 1):
        scene.frame_set(frame)


def instance_collection(scene, collection, name="Instance", **transform):
    """An empty that shows a collection at another place."""
    empty = add_object(scene.collection, name, None)
    empty.instance_type = "COLLECTION"
    empty.instance_collection = collection
    for attribute, value in transform.items():
        setattr(empty, attribute, value)
    return empty


def add_geometry_nodes(item, *nodes):
    """A modifier that sends an object's geometry through nodes of the types named, one after the other."""
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    last = group.nodes.new("NodeGroupInput").outputs[0]
    made = [group.nodes.new(name) for name in nodes]
    for node in made:
        group.links.new(last, node.inputs[0])
        last = node.outputs[0]
    group.links.new(last, group.nodes.new("NodeGroupOutput").inputs[0])
    item.modifiers.new("Nodes", "NODES").node_group = group
    return group, made


def assert_same_points(actual, expected):
    """The same points (N, 3) in any order, to 1e-4."""
    assert len(actual) == len(expected)
    distances = np.linalg.norm(np.asarray(actual)[:, None] - np.asarray(expected)[None], axis=2)
    assert distances.min(axis=0).max() < 1e-4
    assert distances.min(axis=1).max() < 1e-4
