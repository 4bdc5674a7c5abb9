"""Draws the fluid in the 3D viewports.

Blender calls the handler whenever it draws a viewport. The handler reads the scene if it has changed, asks a live view for
images, waits a moment for the first one of what is seen now, so that the fluid does not lag behind the meshes, and draws the
newest. A timer has viewports redrawn while finer images come.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import bpy
import gpu
import numpy as np
import numpy.typing as npt
from bpy.app.handlers import persistent

from ..fluid.balls import Balls
from ..fluid.errors import MeniscusError
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.meshes import Meshes
from ..render.backdrop import Surroundings
from ..render.live_view import LiveRenderer, LiveView, View
from ..render.method import timed
from .changes import CHANGES
from .engine_name import is_engine_view
from .legend import draw_legend
from .method_settings import read_choice
from .preferences import preferences
from .presenter import UNCHANGED, Place, Presenter
from .read_lighting import read_lighting
from .read_scene import Fluid, read_field, read_look, scene_seconds
from .scene_balls import SceneBalls
from .scene_notes import collected_notes
from .surroundings_of_view import ViewSurroundings
from .texture_sharing import SHARING
from .view_camera import ViewCamera, view_camera
from .view_transform import ViewTransforms
from .viewport_status import STATUS

LONGEST_WAIT = 0.045
"""Seconds that the handler may take for reading and for waiting together."""

_TICK = 0.01


@dataclass
class _Viewport:
    """What is kept for a viewport.

    Attributes
    ----------
    live, presenter
        Where its images come from, and what draws them.
    drawn
        The revision of the live view that was drawn last.
    seen, seen_by
        What it looked through last, and by which numbers.
    look
        The look that was drawn last.
    notes
        Sentences on what could not be read as it is.
    """

    live: LiveView
    presenter: Presenter = field(default_factory=Presenter)
    drawn: int = -1
    seen: ViewCamera | None = None
    seen_by: tuple[object, ...] = ()
    look: Look | None = None
    notes: tuple[str, ...] = ()

    def look_at(self, balls: Balls, meshes: Meshes | None) -> ViewCamera | None:
        """The view that Blender is drawing; None where neither balls nor meshes, which images are to show, are in it."""
        _, _, *size = gpu.state.viewport_get()
        matrices = gpu.matrix.get_model_view_matrix(), gpu.matrix.get_projection_matrix()
        seen_by = (*matrices, *size, balls, meshes)
        if seen_by != self.seen_by:
            self.seen, self.seen_by = view_camera(*matrices, *size, _bounds(balls, meshes)), seen_by
        return self.seen

    def drawable(self, look: Look, view: View) -> Look:
        """A look that images of a view can be drawn in: the last one, where they lack what the new one needs."""
        if self.look is None or look.style == self.look.style or set(_passes(look, view.balls)) <= set(view.passes):
            self.look = look
        return self.look


class ViewportDrawing:
    """The fluid in all 3D viewports of Blender."""

    def __init__(self) -> None:
        self._renderer = LiveRenderer()
        self._scene_balls = SceneBalls(CHANGES)
        self._surroundings = ViewSurroundings(CHANGES)
        self._viewports: dict[int, _Viewport] = {}
        self._dropped: list[_Viewport] = []
        self._transforms = ViewTransforms()
        self._legends: dict[int, tuple[float, float]] = {}
        self._paused_at: tuple[int, int] | None = None
        # Blender knows a timer by its address, and a bound method has a new one each time.
        self._timer = self._tick
        add = bpy.types.SpaceView3D.draw_handler_add
        self._handlers = [add(self._draw, (), "WINDOW", "POST_VIEW"), add(self._draw_legend, (), "WINDOW", "POST_PIXEL")]

    def close(self) -> None:
        """Draw no more, and release everything."""
        for handler in self._handlers:
            bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
        if bpy.app.timers.is_registered(self._timer):
            bpy.app.timers.unregister(self._timer)
        self._renderer.close()
        self.forget()
        self._release_dropped()
        SHARING.end()

    def forget(self) -> None:
        """Drop what belongs to the file that was open."""
        for key in list(self._viewports):
            self._drop(key)
        self._scene_balls.forget()
        self._surroundings.forget()
        self._paused_at = None
        STATUS.clear()

    def _draw(self) -> None:
        """Blender's draw handler for what is in the scene."""
        if not is_engine_view(bpy.context):
            self.draw(bpy.context)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the fluid into the viewport that Blender is drawing, with the matrices of its view."""
        started = time.monotonic()
        self._release_dropped()
        key = context.region.as_pointer()
        self._legends.pop(key, None)
        if CHANGES.may_have_sources and context.scene.meniscus.use_viewport:
            self._guarded(lambda: self._draw_fluid(context, key, started))
        else:
            self._show_nothing(key)

    def _draw_legend(self) -> None:
        """Blender's draw handler for what lies over the picture."""
        ends = self._legends.get(bpy.context.region.as_pointer())
        if ends is not None:
            self._guarded(lambda: draw_legend(bpy.context.region, bpy.context.scene, ends))

    def _guarded(self, draw: Callable[[], None]) -> None:
        """Draw, unless that failed and nothing has changed since.

        Nothing may leave a handler: Blender would print it at every redraw.
        """
        if self._paused_at == CHANGES.now:
            return
        self._paused_at = None
        try:
            draw()
        except MeniscusError as error:
            self._stop(str(error), "")
        except Exception as error:  # noqa: BLE001 - whatever it is, the user sees it once and Blender goes on
            self._stop(f"Meniscus failed unexpectedly ({error}): please report it", traceback.format_exc())
        if not bpy.app.timers.is_registered(self._timer):
            bpy.app.timers.register(self._timer, first_interval=_TICK)

    def _stop(self, problem: str, details: str) -> None:
        self._paused_at = CHANGES.now
        STATUS.report(problem, details)

    def _draw_fluid(self, context: bpy.types.Context, key: int, started: float) -> None:
        look = _look(context)
        uses_scene = LOOK_STYLES[look.style].uses_scene
        depsgraph = context.view_layer.depsgraph
        fluid = self._scene_balls.fluid(depsgraph, context.space_data, uses_scene)
        if fluid is None:
            self._show_nothing(key)
            return
        balls, surroundings = fluid.balls, None
        with collected_notes() as notes:
            if uses_scene:
                look = replace(look, sources=fluid.sources, lighting=read_lighting(depsgraph, context.space_data))
            if look.tracing is not None:
                surroundings = self._surroundings.of(context, depsgraph, look.lighting)
        viewport = self._viewport(key)
        viewport.notes = (*fluid.notes, *notes)
        seen = viewport.look_at(balls, None if surroundings is None else surroundings.meshes)
        if seen is None:
            viewport.drawn = viewport.live.revision
            return
        view = _view(context.scene, fluid, seen, look, surroundings)
        if view.choice.backend != "cpu":
            SHARING.begin()
        viewport.live.show(view)
        viewport.live.wait(LONGEST_WAIT - (time.monotonic() - started))
        self._present(viewport, look, seen, context)
        self._report(viewport, balls)

    def _show_nothing(self, key: int) -> None:
        if key in self._viewports:
            self._drop(key)
        STATUS.clear()

    def _viewport(self, key: int) -> _Viewport:
        if key not in self._viewports:
            self._viewports[key] = _Viewport(self._renderer.open())
        return self._viewports[key]

    def _present(self, viewport: _Viewport, look: Look, seen: ViewCamera, context: bpy.types.Context) -> None:
        is_new = viewport.drawn != viewport.live.revision
        viewport.drawn = viewport.live.revision
        pictures = viewport.live.pictures
        if not pictures:
            return
        look = viewport.drawable(look, pictures[0].view)
        if look.style == "speed":
            self._legends[context.region.as_pointer()] = look.speed_range or pictures[0].speed_range
        shown, space = pictures[0].view.camera, context.space_data
        place = Place(seen.projection, seen.offset_of(shown), seen.rectangle_of(shown.window), _has_depth(space))
        milliseconds: dict[str, float] = {}
        with timed(milliseconds, "present"):
            # What the engine draws is scene-linear; Blender transforms it.
            is_linear = is_engine_view(context)
            transform = UNCHANGED if is_linear else self._transforms.of(context.scene, space.shading)
            viewport.presenter.draw(pictures, look, transform, place)
        if is_new:
            viewport.live.note_presenting(pictures[-1], milliseconds["present"] / 1e3)

    def _report(self, viewport: _Viewport, balls: Balls) -> None:
        pictures = viewport.live.pictures
        if pictures:
            info = pictures[0].image.info
            STATUS.show(info, balls.dropped_text, self._transforms.problem, *viewport.notes, *info.notes)
        STATUS.report(*(viewport.live.failure or ("", "")))

    def _tick(self) -> float | None:
        """Have those viewports redrawn for which there is something new; seconds until the next look, None for no more."""
        has_transforms = self._transforms.has_missing
        self._transforms.make_missing()
        regions = {region.as_pointer(): (region, area) for region, area in _view_regions()}
        for key in self._viewports.keys() - regions.keys():
            self._drop(key)
        is_busy = STATUS.has_news or has_transforms
        for key, viewport in self._viewports.items():
            region, area = regions[key]
            has_pictures = self._paused_at is None and viewport.drawn != viewport.live.revision
            if has_pictures or has_transforms:
                region.tag_redraw()
            is_busy |= has_pictures or not viewport.live.is_at_rest
            if STATUS.has_news:
                _redraw_sidebar(area)
        STATUS.has_news = False
        return _TICK if is_busy else None

    def _drop(self, key: int) -> None:
        viewport = self._viewports.pop(key)
        self._renderer.drop(viewport.live)
        self._dropped.append(viewport)

    def _release_dropped(self) -> None:
        """Textures are released where Blender's graphics context is surely active: in a handler."""
        self._dropped.clear()


def _style(context: bpy.types.Context) -> str:
    """The look that a viewport has: that of renders where it shows what the render engine would."""
    settings = context.scene.meniscus
    return str(settings.render_style if is_engine_view(context) else settings.style)


def _look(context: bpy.types.Context) -> Look:
    """How a viewport colours fluid."""
    choices = {} if context.scene.meniscus.use_preview_tracing else {"use_tracing": False}
    return read_look(context.scene, _style(context), choices)


def _bounds(balls: Balls, meshes: Meshes | None) -> npt.NDArray[np.float64]:
    """(2, 3): the box around what images are to show, world space."""
    if meshes is None or not len(meshes.seen):
        return balls.bounds
    low, high = (np.array(sides) for sides in zip(balls.bounds, meshes.seen.bounds, strict=True))
    return np.array([low.min(axis=0), high.max(axis=0)])


def _view(scene: bpy.types.Scene, fluid: Fluid, seen: ViewCamera, look: Look, surroundings: Surroundings | None) -> View:
    balls, settings, chosen, style = fluid.balls, scene.meniscus, preferences(), LOOK_STYLES[look.style]
    return View(
        balls,
        seen.camera.cropped(),
        read_field(scene),
        passes=_passes(look, balls),
        uses_thickness=style.uses_thickness,
        contrast_radius=look.depth_contrast_radius
        if look.depth_contrast > 0 and style.is_lit and not style.uses_scene
        else None,
        look=look if style.uses_scene else None,
        surroundings=surroundings,
        cluster_sources=fluid.cluster_sources,
        counts_clusters=settings.show_clusters,
        display=settings.display,
        choice=read_choice(scene),
        threads=chosen.threads,
        seconds=scene_seconds(scene),
        samples=settings.preview_samples,
        frame_rate=settings.preview_frame_rate,
        memory_limit=chosen.memory_limit << 20,
    )


def _passes(look: Look, balls: Balls) -> tuple[str, ...]:
    """What a look needs of the surface; colours only where the balls have some."""
    if LOOK_STYLES[look.style].uses_scene:
        return "depth", "normal", "combined"
    wanted = (name for name in LOOK_STYLES[look.style].passes if name != "color" or balls.colors is not None)
    return ("depth", "normal", *wanted)


def _has_depth(space: bpy.types.SpaceView3D) -> bool:
    """Whether Blender has the depth of its meshes: up to 4.3 EEVEE leaves it out where overlays are off."""
    if is_engine_view(bpy.context) or space.overlay.show_overlays or space.shading.type not in ("MATERIAL", "RENDERED"):
        return True
    framebuffer = gpu.state.active_framebuffer_get()
    x, y, width, height = framebuffer.viewport_get()
    return bool(np.any(np.asarray(framebuffer.read_depth(x, y + height // 2, width, 1).to_list())))


def _view_regions() -> Iterator[tuple[bpy.types.Region, bpy.types.Area]]:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                yield from ((region, area) for region in area.regions if region.type == "WINDOW")


def _redraw_sidebar(area: bpy.types.Area) -> None:
    for region in area.regions:
        if region.type == "UI":
            region.tag_redraw()


_drawing: ViewportDrawing | None = None


def shows_meshes(context: bpy.types.Context) -> bool:
    """Whether the fluid's images of a viewport of the render engine show the meshes, too."""
    settings = context.scene.meniscus
    is_drawn = _drawing is not None and CHANGES.may_have_sources and settings.use_viewport
    return is_drawn and settings.render_meshes == "SHADED" and _look(context).tracing is not None


def draw_in_engine(context: bpy.types.Context) -> None:
    """Draw the fluid where the render engine draws a viewport."""
    if _drawing is not None:
        _drawing.draw(context)


@persistent
def _forget(*_: object) -> None:
    if _drawing is not None:
        _drawing.forget()


def register() -> None:
    """Draw the fluid from now on, where Blender has windows."""
    global _drawing
    if not bpy.app.background:
        _drawing = ViewportDrawing()
        bpy.app.handlers.load_pre.append(_forget)


def unregister() -> None:
    """Draw it no more."""
    global _drawing
    if _drawing is not None:
        bpy.app.handlers.load_pre.remove(_forget)
        _drawing.close()
        _drawing = None
