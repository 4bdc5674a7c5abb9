"""Depth passes by Cycles, to check cameras against: spheres that are exact, seen through the centres of the pixels."""

import os

import bpy
from exr_files import exr_channels


def add_spheres(scene, centres, radius):
    """A point cloud in `scene`; Cycles draws its points as exact spheres, not as meshes."""
    mesh = bpy.data.meshes.new("Spheres")
    mesh.from_pydata(centres.tolist(), [], [])
    item = bpy.data.objects.new("Spheres", mesh)
    item.modifiers.new("Points", "NODES").node_group = _points_of_mesh(radius)
    scene.collection.objects.link(item)


def cycles_depth(scene, folder):
    """(height, width) float32 Depth pass of the scene's camera, row 0 at the bottom."""
    _set_up_cycles(scene)
    exr = os.path.join(folder, "depth.exr")
    scene.render.filepath = exr
    bpy.ops.render.render(write_still=True)
    return exr_channels(exr)["ViewLayer.Depth.Z"]


def _set_up_cycles(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    # The narrowest filter there is: samples lie within 0.005 pixels of the centres.
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.filter_width = 0.01
    scene.view_layers[0].use_pass_z = True
    image_settings = scene.render.image_settings
    if hasattr(image_settings, "media_type"):
        image_settings.media_type = "MULTI_LAYER_IMAGE"
    image_settings.file_format = "OPEN_EXR_MULTILAYER"
    image_settings.color_depth = "32"
    if hasattr(image_settings, "use_exr_interleave"):
        # Blender 5.0 cannot write a part for each pass where pixels are not square.
        image_settings.use_exr_interleave = True


def _points_of_mesh(radius):
    group = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    entry, points, result = (
        group.nodes.new(name) for name in ("NodeGroupInput", "GeometryNodeMeshToPoints", "NodeGroupOutput")
    )
    points.inputs["Radius"].default_value = radius
    group.links.new(entry.outputs[0], points.inputs["Mesh"])
    group.links.new(points.outputs[0], result.inputs[0])
    return group
