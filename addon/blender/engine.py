"""The render engine: F12 and animations of the fluid."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from functools import partial

import bpy
import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.errors import CancelledError, MeniscusError
from ..fluid.image import ImageBuffers
from ..fluid.passes import PASSES, Pass
from ..render.renderer import render
from ..render.samples import sample_offset
from .preferences import backend_of, threads_of
from .read_camera import read_camera
from .read_scene import read_balls, read_field, read_look

ENGINE = "MENISCUS"

FloatArray = npt.NDArray[np.float32]

# The switches of Blender's view layers that a pass has.
_BLENDER_SWITCHES = {"depth": "use_pass_z", "normal": "use_pass_normal", "position": "use_pass_position"}


def wanted_passes(view_layer: bpy.types.ViewLayer) -> list[Pass]:
    """The passes that a view layer asks for, Combined first."""
    return [image_pass for name, image_pass in PASSES.items() if name == "combined" or _is_wanted(view_layer, name)]


def _is_wanted(view_layer: bpy.types.ViewLayer, name: str) -> bool:
    if name in _BLENDER_SWITCHES:
        return bool(getattr(view_layer, _BLENDER_SWITCHES[name]))
    return bool(getattr(view_layer.meniscus, f"use_pass_{name}"))


class MENISCUS_RE_engine(bpy.types.RenderEngine):
    """Renders the fluid alone; what is around it comes from another engine and is composited by depth."""

    bl_idname = ENGINE
    bl_label = "Meniscus"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer) -> None:
        """Tell the compositor which images there will be."""
        for image_pass in wanted_passes(renderlayer):
            kind = "COLOR" if image_pass.is_color else "VECTOR" if len(image_pass.channels) == 3 else "VALUE"
            count = len(image_pass.channels)
            self.register_pass(scene, renderlayer, image_pass.blender_name, count, image_pass.channels, kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Render a view layer. Nothing may leave it: Blender would stop without a word to the user."""
        try:
            self._render(depsgraph)
        except CancelledError:
            pass
        except MeniscusError as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001 - whatever it is, the user sees it
            traceback.print_exc()
            self._fail(f"Meniscus failed unexpectedly ({error}): please report it with what the console says")

    def _fail(self, sentence: str) -> None:
        """Tell whoever looks at the render window, and whoever reads the console or called the operator."""
        self.error_set(sentence)
        self.report({"ERROR"}, sentence)

    def _render(self, depsgraph: bpy.types.Depsgraph) -> None:
        self.update_stats("", "Reading the scene")
        camera, balls = read_camera(depsgraph), read_balls(depsgraph)
        if balls.dropped_text:
            self.report({"WARNING"}, balls.dropped_text)
        passes = wanted_passes(depsgraph.view_layer)
        scene = depsgraph.scene_eval  # animated settings reach only this one
        shot = partial(
            render,
            balls,
            field=read_field(scene),
            method=scene.meniscus.method,
            backend=backend_of(scene),
            look=read_look(scene),
            is_cancelled=self.test_break,
            threads=threads_of(scene),
        )
        image = shot(camera, passes=[image_pass.name for image_pass in passes])
        image.passes["combined"] = self._mean(image["combined"], shot, camera, scene.meniscus.render_samples)
        self._give(depsgraph, image, passes)

    def _mean(self, first: FloatArray, shot: Callable[..., ImageBuffers], camera: Camera, samples: int) -> FloatArray:
        """(height, width, 4): Combined with all samples, of which the first, through the centres of pixels, is there."""
        total = first.copy()
        for number in range(1, samples):
            self.update_progress(number / samples)
            self.update_stats("", f"Sample {number + 1} of {samples}")
            total += shot(camera.shifted(*sample_offset(number)), passes=("combined",))["combined"]
        self.update_progress(1.0)
        return total / samples

    def _give(self, depsgraph: bpy.types.Depsgraph, image: ImageBuffers, passes: list[Pass]) -> None:
        """Hand an image to Blender, which wants that of the border alone."""
        region = image.camera.active_region
        for image_pass in passes[1:]:
            self.add_pass(
                image_pass.blender_name, len(image_pass.channels), image_pass.channels, layer=depsgraph.view_layer.name
            )
        result = self.begin_result(0, 0, region.width, region.height, layer=depsgraph.view_layer.name)
        layer = result.layers[0]
        for image_pass in passes:
            pixels = image[image_pass.name][region.y_min : region.y_max, region.x_min : region.x_max]
            layer.passes[image_pass.blender_name].rect.foreach_set(np.ascontiguousarray(pixels).reshape(-1))
        self.end_result(result)


def register() -> None:
    """Offer the engine, and show Blender's own panels that hold for it."""
    bpy.utils.register_class(MENISCUS_RE_engine)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Take the engine away."""
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    bpy.utils.unregister_class(MENISCUS_RE_engine)


def _shared_panels() -> list[type[bpy.types.Panel]]:
    """Blender's panels that hold for any engine; they name the engine that Blender once had."""
    panels = bpy.types.Panel.__subclasses__()
    return [panel for panel in panels if "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())]
