"""A view layer of a Blender scene, rendered whole: what the render engine, the export and the command line all do.

First everything is read, on Blender's own thread, which alone may touch the scene. Then it is rendered, on any thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import bpy

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.cryptomatte import Coverage
from ..fluid.deep_image import DeepImage
from ..fluid.displays import METABALLS
from ..fluid.errors import CancelledError, InputError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.meshes import Meshes
from ..fluid.passes import PASSES
from ..render.backdrop import Surroundings
from ..render.cluster_numbers import colored_by_cluster
from ..render.deep import render_deep
from ..render.image_memory import ImageMemory
from ..render.instant import Instant, Sequence
from ..render.method import timed
from ..render.method_choice import MethodChoice
from ..render.pass_images import needed_attributes
from ..render.renderer import render
from ..render.sample_mean import SampleMean
from ..render.samples import sample_offset
from ..render.surroundings import Backdrop, Motion
from .ball_part import FloatArray
from .fluid_motion import needs_neighbors, with_motion
from .method_settings import read_choice
from .moving import may_move
from .preferences import threads_of
from .read_camera import read_camera
from .read_lighting import read_lighting
from .read_meshes import read_meshes, read_moved_vertices
from .read_scene import Fluid, FluidParts, frame_seconds, read_field, read_look, read_parts, scene_seconds
from .scene_notes import collected_notes
from .view_layer_passes import cryptomatte_levels, wanted_passes

MOST_STEPS = 8
"""Points in time at which the scene is read for motion blur."""

SetFrame = Callable[[int, float], None]
"""Brings the dependency graph to a frame and a part of a frame."""


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
    choice
        Of the method, see :class:`method_choice.MethodChoice`.
    threads, display
        See :func:`renderer.render`.
    camera
        None for the scene's.
    resolution
        Width and height in pixels; None for the scene's.
    tracing
        What counts in place of the scene's settings of ray tracing, see :func:`read_scene.read_tracing`.
    """

    passes: tuple[str, ...]
    cryptomatte_levels: int = 0
    samples: int = 1
    choice: MethodChoice = MethodChoice()
    threads: int = 0
    display: str = METABALLS
    camera: bpy.types.Object | None = None
    resolution: tuple[int, int] | None = None
    tracing: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, **choices: Any) -> RenderSettings:
        """What a scene and a view layer say, but for `choices` that are not None."""
        own = {
            "passes": tuple(image_pass.name for image_pass in wanted_passes(view_layer)),
            "cryptomatte_levels": cryptomatte_levels(view_layer),
            "samples": scene.meniscus.render_samples,
            "choice": read_choice(scene).unhurried,
            "threads": threads_of(scene),
            "display": scene.meniscus.display,
        }
        return cls(**{**own, **{name: choice for name, choice in choices.items() if choice is not None}})

    @property
    def mean_passes(self) -> tuple[str, ...]:
        """What is asked of each sample; the mattes count the objects that they see."""
        names = tuple(name for name in self.passes if PASSES[name].is_antialiased)
        return (*names, "object_index") if self.cryptomatte_levels else names

    @property
    def first_passes(self) -> tuple[str, ...]:
        """What the rays through the centres of the pixels are asked for."""
        return tuple(dict.fromkeys((*self.passes, *(("object_index",) if self.cryptomatte_levels else ()))))


@dataclass(frozen=True)
class Control:
    """How a render and whoever asked for it speak to one another.

    Attributes
    ----------
    is_cancelled
        Asked again and again; where it returns True, CancelledError is raised.
    on_progress
        Told the share that is done, 0 to 1, and what is being done.
    memory
        Where images come from: that of one is used again for the next that is rendered under this control.
    sequence
        What the images under this control belong to.
    """

    is_cancelled: Callable[[], bool]
    on_progress: Callable[[float, str], None] = lambda share, text: None
    memory: ImageMemory = field(default_factory=ImageMemory)
    sequence: Sequence = field(default_factory=Sequence)

    def watch(self, _share: float) -> None:
        """What native work calls."""
        if self.is_cancelled():
            raise CancelledError("The render was cancelled")


@dataclass(frozen=True)
class _Moment:
    """What there is to be seen at one time, in seconds by the clock of the scene."""

    seconds: float
    camera: Camera
    fluid: Fluid
    field: Field
    look: Look
    surroundings: Surroundings

    @property
    def object_names(self) -> tuple[str, ...]:
        meshes = self.surroundings.meshes
        others = meshes.objects if meshes is not None else ()
        return tuple(item.name for item in (*self.look.sources, *others))

    def backdrop(self, camera: Camera, threads: int, control: Control, motion: Motion | None = None) -> Backdrop | None:
        """What else than fluid is seen, with its motion where that is given; None where that is nothing."""
        return self.surroundings.backdrop(camera.cropped(), threads, control.watch, motion)


@dataclass(frozen=True)
class _Neighbor:
    """What was read of one frame before or after; None for what is not asked for, or cannot be read."""

    camera: Camera | None = None
    fluid: FluidParts | None = None
    vertices: FloatArray | None = None


_Neighbors = tuple[_Neighbor, _Neighbor]


@dataclass(frozen=True)
class SceneRender:
    """A view layer at one frame, read and ready to be rendered on any thread. Made by :func:`read_view_layer`.

    Attributes
    ----------
    settings
        How it is rendered.
    milliseconds
        The time that reading took.
    notes
        Sentences on what could not be read as it is.
    """

    settings: RenderSettings
    moment: _Moment
    motion: Motion | None
    shutter: tuple[_Moment, ...]
    milliseconds: dict[str, float]
    notes: tuple[str, ...] = ()

    def image(self, control: Control) -> ImageBuffers:
        """The passes; the report begins with the stage "read".

        Raises
        ------
        InputError, DeviceError, CancelledError
            Each with one sentence for the user.
        """
        image = self._shot(self.moment, self.moment.camera, self.settings.first_passes, control, self.motion)
        self._antialias(image, control)
        image.info.milliseconds = {**self.milliseconds, **image.info.milliseconds}
        image.info.notes = (*self.notes, *image.info.notes)
        return image

    def deep_image(self, control: Control) -> DeepImage:
        """The fluid in depth, without motion blur; what hides it ends it. The errors are those of :meth:`image`."""
        moment, settings = self.moment, self.settings
        if settings.display != METABALLS:
            raise InputError("Deep files hold the inside of metaballs: display the balls as these, or write no deep file")
        return render_deep(
            self._balls(moment, control),
            moment.camera,
            moment.field,
            **settings.choice.options,
            look=moment.look,
            is_cancelled=control.is_cancelled,
            threads=settings.threads,
            backdrop=moment.backdrop(moment.camera, settings.threads, control),
        )

    def _balls(self, moment: _Moment, control: Control) -> Balls:
        """With the colours of clusters where sources ask for these."""
        chosen, threads = moment.fluid.cluster_sources, self.settings.threads
        if not chosen:
            return moment.fluid.balls
        return colored_by_cluster(moment.fluid.balls, moment.field, chosen, threads=threads, watch=control.watch)

    def _shot(
        self,
        moment: _Moment,
        camera: Camera,
        passes: tuple[str, ...],
        control: Control,
        motion: Motion | None = None,
        sample: int = 0,
    ) -> ImageBuffers:
        return render(
            self._balls(moment, control),
            camera,
            moment.field,
            **self.settings.choice.options,
            passes=passes,
            look=moment.look,
            is_cancelled=control.is_cancelled,
            threads=self.settings.threads,
            backdrop=moment.backdrop(camera, self.settings.threads, control, motion),
            motion=motion,
            memory=control.memory,
            sample=sample,
            display=self.settings.display,
            instant=Instant(moment.seconds, control.sequence),
        )

    def _antialias(self, image: ImageBuffers, control: Control) -> None:
        """Replace the antialiased passes of an image by the means of samples."""
        levels, names = self.settings.cryptomatte_levels, self.settings.mean_passes
        mean = SampleMean(Coverage(levels) if levels else None)
        if names and not self.shutter:
            mean.add(image, self.moment.object_names)
        with timed(image.info.milliseconds, "samples"):
            for number, moment in self._further_samples():
                control.on_progress(number / self.settings.samples, f"Sample {number + 1} of {self.settings.samples}")
                image_of_sample = self._shot(
                    moment, moment.camera.shifted(*sample_offset(number)), names, control, sample=number
                )
                mean.add(image_of_sample, moment.object_names)
        mean.put_into(image)

    def _further_samples(self) -> Iterator[tuple[int, _Moment]]:
        """Numbers of the samples that are still to be rendered, and what they see."""
        if not self.settings.mean_passes:
            return
        if not self.shutter:
            yield from ((number, self.moment) for number in range(1, self.settings.samples))
            return
        for step, moment in enumerate(self.shutter):
            yield from ((number, moment) for number in range(step, self.settings.samples, len(self.shutter)))


def read_view_layer(depsgraph: bpy.types.Depsgraph, settings: RenderSettings, set_frame: SetFrame) -> SceneRender:
    """Read a view layer at the frame that its dependency graph has, with the scene's own look.

    Motion, and motion blur, take the dependency graph to other times, and back.

    Raises
    ------
    InputError
        One sentence for the user.
    """
    milliseconds: dict[str, float] = {}
    with timed(milliseconds, "read"), collected_notes() as notes:
        read = _Reader(depsgraph, settings, set_frame).read()
    return SceneRender(settings, *read, milliseconds, tuple(notes))


@dataclass(frozen=True)
class _Reader:
    depsgraph: bpy.types.Depsgraph
    settings: RenderSettings
    set_frame: SetFrame

    @property
    def _scene(self) -> bpy.types.Scene:
        return self.depsgraph.scene_eval  # animated settings reach only this one

    def read(self) -> tuple[_Moment, Motion | None, tuple[_Moment, ...]]:
        """What there is to be seen now, how it moves where passes ask for that, and what is seen while the shutter is open."""
        fluid, meshes = self._fluid(), self._meshes()
        with self._other_times() as set_time:
            neighbors = self._neighbors(fluid, meshes, set_time)
            shutter = self._shutter(neighbors, set_time)
        moment = self._moment_of(self._moving(fluid, neighbors), meshes)
        return moment, self._motion(moment.camera, neighbors), shutter

    def _moving(self, fluid: FluidParts, neighbors: _Neighbors, time: float = 0.0) -> Fluid:
        """Fluid that was read so many frames from now, all of it with velocities if its neighbours are known."""
        before, after = (neighbor.fluid for neighbor in neighbors)
        if before is not None or after is not None:
            fluid = with_motion(
                fluid, before, after, ((1 + time) * frame_seconds(self._scene), (1 - time) * frame_seconds(self._scene))
            )
        return fluid.joined()

    def _motion(self, camera: Camera, neighbors: _Neighbors) -> Motion | None:
        if "vector" not in self.settings.passes:
            return None
        cameras = (camera if neighbor.camera is None else neighbor.camera for neighbor in neighbors)
        return Motion(*cameras, frame_seconds(self._scene), *(neighbor.vertices for neighbor in neighbors))

    def _moment_of(self, fluid: Fluid, meshes: Meshes | None) -> _Moment:
        """What there is to be seen now, with fluid and meshes that are read already."""
        scene, settings = self._scene, self._scene.meniscus
        lighting = read_lighting(self.depsgraph)
        is_clear = scene.render.film_transparent or not self.depsgraph.view_layer.use_sky
        return _Moment(
            seconds=scene_seconds(scene),
            camera=self._camera(),
            fluid=fluid,
            field=read_field(scene),
            look=replace(self._look(), sources=fluid.sources, lighting=lighting),
            surroundings=Surroundings(meshes, lighting, is_clear, are_holdouts=settings.render_meshes == "HOLDOUT"),
        )

    def _look(self) -> Look:
        return read_look(self._scene, self._scene.meniscus.render_style, self.settings.tracing)

    def _fluid(self) -> FluidParts:
        return read_parts(self.depsgraph, uses_materials=LOOK_STYLES[self._look().style].uses_scene)

    def _meshes(self) -> Meshes | None:
        if self._scene.meniscus.render_meshes == "NONE":
            return None
        return read_meshes(self.depsgraph, is_traced=self._look().tracing is not None)

    def _neighbors(self, fluid: FluidParts, meshes: Meshes | None, set_time: Callable[[float], None]) -> _Neighbors:
        """What may move, one frame before and one frame after."""
        needs_vectors = "vector" in self.settings.passes
        readers: dict[str, Callable[[], Any]] = {}
        if needs_vectors and self._camera_may_move:
            readers["camera"] = self._camera
        if self._needs_velocities(self.settings.passes) and needs_neighbors(fluid):
            readers["fluid"] = self._fluid
        if needs_vectors and meshes is not None and len(meshes) and self._objects_may_move:
            readers["vertices"] = partial(read_moved_vertices, self.depsgraph, meshes)
        if not readers:
            return _Neighbor(), _Neighbor()
        return self._neighbor(-1, set_time, readers), self._neighbor(1, set_time, readers)

    def _neighbor(self, step: float, set_time: Callable[[float], None], readers: dict[str, Callable[[], Any]]) -> _Neighbor:
        set_time(step)
        found = {}
        for name, read in readers.items():
            # What cannot be read there is no reason not to render what is here.
            with suppress(InputError):
                found[name] = read()
        return _Neighbor(**found)

    def _needs_velocities(self, passes: tuple[str, ...]) -> bool:
        return "velocity" in needed_attributes(passes, self._look())

    def _shutter(self, neighbors: _Neighbors, set_time: Callable[[float], None]) -> tuple[_Moment, ...]:
        """What is seen while the shutter is open; nothing without motion blur."""
        render = self._scene.render
        if not (render.use_motion_blur and render.motion_blur_shutter > 0 and self.settings.mean_passes):
            return ()
        steps = min(self.settings.samples, MOST_STEPS)
        start = {"START": 0.0, "CENTER": -0.5, "END": -1.0}[render.motion_blur_position]
        times = [(start + (step + 0.5) / steps) * render.motion_blur_shutter for step in range(steps)]
        return tuple(self._moment_at(time, neighbors, set_time) for time in times)

    def _moment_at(self, time: float, neighbors: _Neighbors, set_time: Callable[[float], None]) -> _Moment:
        set_time(time)
        fluid, needs_velocities = self._fluid(), self._needs_velocities(self.settings.mean_passes)
        return self._moment_of(self._moving(fluid, neighbors, time) if needs_velocities else fluid.joined(), self._meshes())

    @property
    def _camera_may_move(self) -> bool:
        camera = self.settings.camera or self.depsgraph.scene.camera
        return camera is not None and may_move(camera.evaluated_get(self.depsgraph), self.depsgraph.scene)

    @property
    def _objects_may_move(self) -> bool:
        """Whether anything but cameras and lights may."""
        scene = self.depsgraph.scene
        objects = (item for item in self.depsgraph.ids if isinstance(item, bpy.types.Object))
        return any(may_move(item, scene) for item in objects if item.type not in {"CAMERA", "LIGHT"})

    def _camera(self) -> Camera:
        return read_camera(self.depsgraph, self.settings.camera, self.settings.resolution)

    @contextmanager
    def _other_times(self) -> Iterator[Callable[[float], None]]:
        """Gives a function that brings the dependency graph so many frames from now; in the end it is brought back."""
        now = self._scene.frame_current + self._scene.frame_subframe
        has_left = False

        def set_time(step: float) -> None:
            nonlocal has_left
            has_left = True
            frame = math.floor(now + step)
            self.set_frame(frame, now + step - frame)

        try:
            yield set_time
        finally:
            if has_left:
                set_time(0.0)
