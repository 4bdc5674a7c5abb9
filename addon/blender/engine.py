"""The render engine: F12, animations and Rendered viewports."""

from __future__ import annotations

import traceback

import bpy
import gpu
import numpy as np
from bpy.app.handlers import persistent

from ..fluid.cryptomatte import layer_names
from ..fluid.errors import CancelledError, MeniscusError
from ..fluid.image import ImageBuffers
from ..fluid.passes import Pass
from ..render.instant import Sequence
from .engine_name import ENGINE
from .handlers import add_handlers, remove_handlers
from .read_lighting import read_lighting
from .read_meshes import read_meshes
from .render_scene import Control, RenderSettings, read_view_layer
from .rendered_view import RenderedMeshes, view_matrices
from .view_layer_passes import cryptomatte_levels, wanted_passes
from .viewport import draw_in_engine, shows_meshes
from .viewport_status import STATUS
from .world_background import WorldBackground

_MATTE_CHANNELS = "rgba"
"""As Cycles names them, so that they are not taken for colours."""


def _name_of(image_pass: Pass) -> str:
    """Blender's name of a pass; one of them has changed."""
    if image_pass.name == "object_index" and bpy.app.version < (5, 0):
        return "IndexOB"
    return image_pass.blender_name


class MENISCUS_RE_engine(bpy.types.RenderEngine):
    """Renders the fluid in the light of the scene, with what hides it."""

    bl_idname = ENGINE
    bl_label = "Meniscus"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    _behind: WorldBackground | None = None

    def update_render_passes(self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer) -> None:
        """Tell the compositor which images there will be."""
        for image_pass in wanted_passes(renderlayer):
            count = len(image_pass.channels)
            kind = "COLOR" if image_pass.is_color else "VALUE" if count == 1 else "VECTOR"
            self.register_pass(scene, renderlayer, _name_of(image_pass), count, image_pass.channels, kind)
        for name in layer_names(cryptomatte_levels(renderlayer)):
            self.register_pass(scene, renderlayer, name, 4, _MATTE_CHANNELS, "COLOR")

    def view_update(self, _context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Something in the scene of a Rendered viewport has changed."""
        self._shown: RenderedMeshes | None = None
        lighting = read_lighting(depsgraph)
        if lighting.image is None:
            self._behind = None
        elif self._behind is None or self._behind.lighting != lighting:
            self._behind = WorldBackground(lighting)
        self._world = lighting.world

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw a Rendered viewport, scene-linear. Nothing may leave it: Blender would print it each time."""
        try:
            with view_matrices(context.region_data):
                self._draw_surroundings(context, depsgraph)
                draw_in_engine(context)
        except MeniscusError as error:
            STATUS.report(str(error), "")
        except Exception as error:  # noqa: BLE001 - whatever it is, the user sees it
            STATUS.report(f"Meniscus failed unexpectedly ({error}): please report it", traceback.format_exc())

    def _draw_surroundings(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        scene = depsgraph.scene
        if not scene.render.film_transparent:
            gpu.state.active_framebuffer_get().clear(color=(*self._world, 1.0))
            if self._behind is not None:
                self._behind.draw()
        if scene.meniscus.render_meshes == "NONE" or shows_meshes(context):
            return
        if self._shown is None:
            space = context.space_data
            self._shown = RenderedMeshes(read_meshes(depsgraph, viewport=space), read_lighting(depsgraph, space))
        self._shown.draw(are_holdouts=scene.meniscus.render_meshes == "HOLDOUT")

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
        view_layer = depsgraph.view_layer
        # The resolution is not the scene's own where the compositor of another scene asks.
        settings = RenderSettings.of(depsgraph.scene_eval, view_layer, resolution=(self.resolution_x, self.resolution_y))
        self._show_progress(0.0, "Reading the scene")
        read = read_view_layer(depsgraph, settings, lambda frame, subframe: self.frame_set(frame, subframe=subframe))
        sequence = _sequence_of(depsgraph.scene.name_full, view_layer.name)
        image = read.image(Control(self.test_break, self._show_progress, sequence=sequence))
        for sentence in filter(None, (image.info.dropped_text, *image.info.notes)):
            self.report({"WARNING"}, sentence)
        self._give(view_layer, image)

    def _show_progress(self, share: float, text: str) -> None:
        self.update_progress(share)
        self.update_stats("", text)

    def _give(self, view_layer: bpy.types.ViewLayer, image: ImageBuffers) -> None:
        """Hand an image to Blender, which wants that of the border alone."""
        region, passes = image.camera.active_region, wanted_passes(view_layer)
        for image_pass in passes[1:]:
            channels = image_pass.channels
            self.add_pass(_name_of(image_pass), len(channels), channels, layer=view_layer.name)
        images = {_name_of(image_pass): image[image_pass.name] for image_pass in passes}
        if image.cryptomatte is not None:
            for name in image.cryptomatte.layers:
                self.add_pass(name, 4, _MATTE_CHANNELS, layer=view_layer.name)
            images |= image.cryptomatte.layers
        result = self.begin_result(0, 0, region.width, region.height, layer=view_layer.name)
        layer = result.layers[0]
        for name, pixels in images.items():
            part = pixels[region.y_min : region.y_max, region.x_min : region.x_max]
            layer.passes[name].rect.foreach_set(np.ascontiguousarray(part).reshape(-1))
        self.end_result(result)
        if image.cryptomatte is not None:
            whole = self.get_result()
            for key, value in image.cryptomatte.metadata(view_layer.name).items():
                whole.stamp_data_add_field(key, value)


# Blender makes an engine for each frame of an animation.
_sequences: dict[tuple[str, str], Sequence] = {}


def _sequence_of(scene: str, view_layer: str) -> Sequence:
    """What the frames of a view layer belong to while Blender renders."""
    return _sequences.setdefault((scene, view_layer), Sequence())


@persistent
def _end_sequences(*_: object) -> None:
    _sequences.clear()


_HANDLERS = dict.fromkeys(("render_complete", "render_cancel", "load_pre"), _end_sequences)


def register() -> None:
    """Offer the engine, and show Blender's own panels that hold for it."""
    bpy.utils.register_class(MENISCUS_RE_engine)
    add_handlers(_HANDLERS)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Take the engine away."""
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    remove_handlers(_HANDLERS)
    _end_sequences()
    bpy.utils.unregister_class(MENISCUS_RE_engine)


def _shared_panels() -> list[type[bpy.types.Panel]]:
    """Blender's panels that hold for any engine; they name the engine that Blender once had."""
    panels = bpy.types.Panel.__subclasses__()
    return [panel for panel in panels if "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())]
