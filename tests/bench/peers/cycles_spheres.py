"""Cycles with a point cloud of plain spheres: what a first-rate ray caster takes for spheres that do not blend."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from .peer import Case, Stopwatch, Task

if TYPE_CHECKING:
    import bpy

CASES = (
    Case(
        "cycles_spheres",
        "Cycles, plain spheres, 640x480, 1 sample",
        "wyvill",
        0.4,
        "spheres",
        "picture",
        "spheres of the kernel radius, no surface that blends: the floor, without the work of a field; judged by the union "
        "of those spheres; time without Blender's own part of a render, which its status messages tell",
    ),
)


class CyclesSpheres:
    """A point cloud and a camera; depth and normal beside the picture, no ray but those from the eye."""

    def __init__(self, task: Task) -> None:
        # Imported here because the cases are read where there is no Blender.
        import bpy

        from . import blender

        self._bpy = bpy
        self._positions = task.positions
        scene = blender.empty_scene()
        _set_up_render(scene, task)
        self._cloud = bpy.data.pointclouds.new("Peer")
        self._cloud.resize(len(task.positions))
        radii = self._cloud.attributes.new("radius", "FLOAT", "POINT")
        radii.data.foreach_set("value", np.full(len(task.positions), task.kernel_radius, np.float32))
        self._cloud.materials.append(_glowing(bpy.data.materials.new("Peer")))
        blender.add_object(scene, self._cloud)
        scene.camera = blender.add_object(scene, bpy.data.cameras.new("Peer"))
        _place_camera(scene.camera, task)
        self._messages: list[tuple[float, str]] = []
        bpy.app.handlers.render_stats.append(self._listen)

    def surface(self) -> dict[str, float]:
        """Cycles' build lasts from its first message to that of the first sample, its cast from there to the last sample."""
        watch = Stopwatch()
        with watch.stage("hand over"):
            self._cloud.attributes["position"].data.foreach_set("vector", self._positions.reshape(-1))
        self._cloud.update_tag()
        self._messages.clear()
        with watch.stage("whole render"):
            self._bpy.ops.render.render()
        begin, first, last = (self._moment_of(text) for text in ("", "Sample 0/1", "Sample 1/1"))
        cycles = {"build": (first - begin) * 1e3, "cast": (last - first) * 1e3, "surface": (last - begin) * 1e3}
        return {**watch.milliseconds, **cycles}

    def save_picture(self, path: str) -> None:
        self._bpy.data.images["Render Result"].save_render(path)

    def _listen(self, message: Any, *_: Any) -> None:
        self._messages.append((time.perf_counter(), str(message)))

    def _moment_of(self, text: str) -> float:
        return next(moment for moment, message in self._messages if text in message)


def _set_up_render(scene: bpy.types.Scene, task: Task) -> None:
    render, cycles, layer = scene.render, scene.cycles, scene.view_layers[0]
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = task.width, task.height, 100
    render.use_compositing = render.use_sequencer = False
    cycles.device = "CPU"
    cycles.samples, cycles.max_bounces = 1, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    # The narrowest filter there is, so that rays pass through the centres of the pixels.
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 0.01
    layer.use_pass_z = layer.use_pass_normal = True
    render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"


def _glowing(material: bpy.types.Material) -> bpy.types.Material:
    """A material that only emits: from one that reflects Cycles casts a further ray, also where no bounce is allowed."""
    nodes = material.node_tree.nodes
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material


def _place_camera(camera: bpy.types.Object, task: Task) -> None:
    # Imported here like bpy, which it is a part of. A plain list would be taken for the columns of the matrix.
    from mathutils import Matrix

    camera.matrix_world = Matrix(task.world_from_view.tolist())
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle = task.field_of_view
    camera.data.clip_end = 2 * float(np.linalg.norm(task.world_from_view[:3, 3] - task.positions.mean(axis=0)))


create = CyclesSpheres
