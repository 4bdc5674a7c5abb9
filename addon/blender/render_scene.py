"""A view layer of a Blender scene, rendered whole: what the render engine and the command line both do."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import bpy

from ..fluid.camera import Camera
from ..fluid.cryptomatte import Coverage
from ..fluid.errors import CancelledError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.meshes import Meshes
from ..fluid.passes import PASSES
from ..render.backdrop import backdrop
from ..render.method import timed
from ..render.renderer import render
from ..render.sample_mean import SampleMean
from ..render.samples import sample_offset
from ..render.surroundings import Backdrop, Motion
from .read_camera import read_camera
from .read_materials import read_lighting
from .read_meshes import read_meshes
from .read_scene import Fluid, read_field, read_fluid, read_look

MOST_STEPS = 8
"""Points in time at which the scene is read for motion blur."""


@dataclass(frozen=True)
class RenderSettings:
    """How a view layer is rendered.

    Attributes
    ----------
    passes
        Names from :data:`passes.PASSES`.
    cryptomatte_levels
        How many objects a pixel names in the mattes; 0 for no mattes.
    samples
        A pixel's, of the antialiased passes.
    method, backend, threads
        See :func:`renderer.render`.
    camera
        None for the scene's.
    resolution
        Width and height in pixels; None for the scene's.
    """

    passes: tuple[str, ...]
    cryptomatte_levels: int = 0
    samples: int = 1
    method: str = "auto"
    backend: str = "auto"
    threads: int = 0
    camera: bpy.types.Object | None = None
    resolution: tuple[int, int] | None = None


@dataclass(frozen=True)
class RenderControl:
    """How a render and whoever asked for it speak to one another.

    Attributes
    ----------
    set_frame
        Brings the dependency graph to a frame and a part of a frame.
    is_cancelled
        Asked again and again; where it returns True, CancelledError is raised.
    on_progress
        Told the share that is done, 0 to 1, and what is being done.
    """

    set_frame: Callable[[int, float], None]
    is_cancelled: Callable[[], bool]
    on_progress: Callable[[float, str], None] = lambda share, text: None


def render_scene(depsgraph: bpy.types.Depsgraph, settings: RenderSettings, control: RenderControl) -> ImageBuffers:
    """Render a view layer at the frame that its dependency graph has, with the scene's own look.

    Parameters
    ----------
    depsgraph
        Evaluated dependency graph.
    settings, control
        How.

    Returns
    -------
    ImageBuffers with the passes that were asked for; its report names the reading of the scene as the stage "read".

    Raises
    ------
    InputError, DeviceError, CancelledError
        Each with one sentence for the user.
    """
    return _SceneRender(depsgraph, settings, control).image()


@dataclass(frozen=True)
class _Moment:
    """What there is to be seen at one time."""

    camera: Camera
    fluid: Fluid
    field: Field
    look: Look
    background: tuple[float, float, float, float]
    meshes: Meshes | None

    @property
    def object_names(self) -> tuple[str, ...]:
        others = self.meshes.objects if self.meshes is not None else ()
        return tuple(item.name for item in (*self.look.sources, *others))


@dataclass
class _SceneRender:
    depsgraph: bpy.types.Depsgraph
    settings: RenderSettings
    control: RenderControl
    milliseconds: dict[str, float] = field(default_factory=dict)

    def image(self) -> ImageBuffers:
        self.control.on_progress(0.0, "Reading the scene")
        with timed(self.milliseconds, "read"):
            moment, motion = self._moment(), self._motion()
        image = self._shot(moment, moment.camera, self._first_passes, motion)
        self._antialias(image, moment)
        image.info.milliseconds = {**self.milliseconds, **image.info.milliseconds}
        return image

    @property
    def _scene(self) -> bpy.types.Scene:
        return self.depsgraph.scene_eval  # animated settings reach only this one

    @property
    def _has_blur(self) -> bool:
        return self._scene.render.use_motion_blur and self._scene.render.motion_blur_shutter > 0 and bool(self._mean_passes)

    @property
    def _mean_passes(self) -> tuple[str, ...]:
        """What is asked of each sample; the mattes count the objects that they see."""
        names = tuple(name for name in self.settings.passes if PASSES[name].is_antialiased)
        return (*names, "object_index") if self.settings.cryptomatte_levels else names

    @property
    def _first_passes(self) -> tuple[str, ...]:
        """What the rays through the centres of the pixels are asked for."""
        names = dict.fromkeys(self.settings.passes)
        if self.settings.cryptomatte_levels:
            names["object_index"] = None
        return tuple(names)

    def _moment(self) -> _Moment:
        scene = self._scene
        look = read_look(scene, scene.meniscus.render_style)
        fluid = read_fluid(self.depsgraph, uses_materials=LOOK_STYLES[look.style].uses_scene)
        lighting = read_lighting(self.depsgraph)
        is_clear = scene.render.film_transparent or not self.depsgraph.view_layer.use_sky
        return _Moment(
            camera=read_camera(self.depsgraph, self.settings.camera, self.settings.resolution),
            fluid=fluid,
            field=read_field(scene),
            look=replace(look, sources=fluid.sources, lighting=lighting),
            background=(0.0, 0.0, 0.0, 0.0) if is_clear else (*lighting.world, 1.0),
            meshes=read_meshes(self.depsgraph) if scene.meniscus.render_meshes != "NONE" else None,
        )

    def _motion(self) -> Motion | None:
        """The camera's from frame to frame, for those who ask for it."""
        if "vector" not in self.settings.passes:
            return None
        render = self._scene.render
        previous, following = (self._camera_at(step) for step in (-1, 1)) if self._camera_moves else (self._camera_at(0),) * 2
        return Motion(previous, following, render.fps_base / render.fps)

    @property
    def _camera_moves(self) -> bool:
        """Whether the camera may be elsewhere in other frames."""
        camera = self.settings.camera or self.depsgraph.scene.camera
        return camera is not None and bool(
            camera.animation_data or camera.parent or camera.constraints or camera.data.animation_data
        )

    def _camera_at(self, step: float) -> Camera:
        if step == 0:
            return read_camera(self.depsgraph, self.settings.camera, self.settings.resolution)
        with self._another_time(step):
            return self._camera_at(0)

    @contextmanager
    def _another_time(self, step: float) -> Iterator[None]:
        """Have the dependency graph show a time so many frames later."""
        now = self._scene.frame_current + self._scene.frame_subframe
        self._set_time(now + step)
        try:
            yield
        finally:
            self._set_time(now)

    def _set_time(self, time: float) -> None:
        frame = math.floor(time)
        self.control.set_frame(frame, time - frame)

    def _backdrop(self, moment: _Moment, camera: Camera) -> Backdrop | None:
        """What else than fluid is seen; None where that is nothing."""
        if moment.meshes is None or not len(moment.meshes):
            return Backdrop.empty(camera.cropped(), moment.background) if moment.background[3] > 0 else None
        return backdrop(
            moment.meshes,
            camera.cropped(),
            moment.look.lighting,
            moment.background,
            are_holdouts=self._scene.meniscus.render_meshes == "HOLDOUT",
            threads=self.settings.threads,
            watch=self._watch,
        )

    def _watch(self, _share: float) -> None:
        if self.control.is_cancelled():
            raise CancelledError("The render was cancelled")

    def _shot(self, moment: _Moment, camera: Camera, passes: tuple[str, ...], motion: Motion | None = None) -> ImageBuffers:
        return render(
            moment.fluid.balls,
            camera,
            moment.field,
            method=self.settings.method,
            backend=self.settings.backend,
            passes=passes,
            look=moment.look,
            is_cancelled=self.control.is_cancelled,
            threads=self.settings.threads,
            backdrop=self._backdrop(moment, camera),
            motion=motion,
        )

    def _antialias(self, image: ImageBuffers, moment: _Moment) -> None:
        """Replace the antialiased passes of an image by the means of samples."""
        levels = self.settings.cryptomatte_levels
        mean = SampleMean(Coverage(levels) if levels else None)
        if self._mean_passes and not self._has_blur:
            mean.add(image, moment.object_names)
        with timed(self.milliseconds, "samples"):
            for number, now in self._further_samples(moment):
                self.control.on_progress(number / self.settings.samples, f"Sample {number + 1} of {self.settings.samples}")
                shot = self._shot(now, now.camera.shifted(*sample_offset(number)), self._mean_passes)
                mean.add(shot, now.object_names)
        mean.put_into(image)

    def _further_samples(self, moment: _Moment) -> Iterator[tuple[int, _Moment]]:
        """Numbers of the samples that are still to be rendered, and what they see."""
        if not self._mean_passes:
            return
        if not self._has_blur:
            yield from ((number, moment) for number in range(1, self.settings.samples))
            return
        steps = min(self.settings.samples, MOST_STEPS)
        for step in range(steps):
            with self._another_time(self._shutter_time((step + 0.5) / steps)):
                now = self._moment()
            yield from ((number, now) for number in range(step, self.settings.samples, steps))

    def _shutter_time(self, share: float) -> float:
        """Frames from the present one to a share of the time that the shutter is open."""
        render = self._scene.render
        start = {"START": 0.0, "CENTER": -0.5, "END": -1.0}[render.motion_blur_position]
        return float((start + share) * render.motion_blur_shutter)
