"""Depth passes by Cycles, to check cameras against: spheres that are exact, seen through the centres of the pixels."""

import os

import bpy
from exr_files import exr_content


def add_spheres(scene, centres, radius):
    """An object in `scene` with a point cloud, whose points Cycles draws as exact spheres, not as meshes."""
    mesh = bpy.data.meshes.new("Spheres")
    mesh.from_pydata(centres.tolist(), [], [])
    item = bpy.data.objects.new("Spheres", mesh)
    item.modifiers.new("Points", "NODES").node_group = _points_of_mesh(radius)
    scene.collection.objects.link(item)
    return item


def cycles_depth(scene, folder):
    """(height, width) float32 Depth pass of the scene's camera, row 0 at the bottom."""
    set_up_cycles(scene)
    return passes_of_render(scene, os.path.join(folder, "depth.exr"))[0]["ViewLayer.Depth.Z"]


def passes_of_render(scene, path):
    """Render the scene's camera with the scene's engine; what the file at `path` then holds, see :func:`exr_content`."""
    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return exr_content(path)


def set_up_cycles(scene):
    """Cycles with one sample through the centres of the pixels, and renders saved as multilayer files."""
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
