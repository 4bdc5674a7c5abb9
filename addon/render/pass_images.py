"""The passes, made from the surface that a method has found and from what else there is at each pixel."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.lighting import FluidSource, Material
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.passes import DEPTH_BACKGROUND, PASSES
from ..fluid.tracing import Tracing
from . import native
from .cluster_numbers import number_clusters
from .depth_contrast import spatial_importance
from .material_shading import shade_image
from .method import Attribute, Request, Surface
from .shading import Ranges, SurfacePoints, directions_to_eye, shaded, view_normals
from .spans import find_spans
from .surroundings import Backdrop, Color, Motion
from .thickness import at_pixels, thickness_image
from .tracing import SeenSurface, TracedScene, Tracer, trace_image

FloatArray = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]

# What a pass needs of the surface beside depth and normal.
NEEDED: dict[str, Attribute] = {
    "color": "color",
    "velocity": "velocity",
    "speed": "velocity",
    "vector": "velocity",
    "ball_id": "ball",
    "cluster_id": "ball",
    "object_index": "ball",
}


def needed_attributes(names: Iterable[str], look: Look) -> frozenset[Attribute]:
    """What passes need of the surface, Combined and Alpha with all that their look shows."""
    asked = set(names)
    if not asked.isdisjoint({"combined", "alpha"}):
        asked.update(LOOK_STYLES[look.style].passes)
    return frozenset(NEEDED[name] for name in asked if name in NEEDED)


# Passes that follow from where the surface lies, with the shape of their pixels.
_PLACES: dict[str, tuple[int, ...]] = {"position": (3,), "facing": (), "vector": (4,), "speed": ()}


class PassImages:
    """All passes of one image, each made when it is asked for: arrays of the rendered region, row 0 at the bottom.

    Parameters
    ----------
    surface, request
        What was found, and what was asked for.
    camera
        What the image shows; the request's is its region.
    look
        Colours and light.
    backdrop
        What else there is.
    motion
        Of the camera, which meshes have as ways in the backdrop; None where it stands still.
    names
        The passes that will be asked for.
    sample
        How many images of this view were made before; traced light has other samples in each.
    """

    def __init__(
        self,
        surface: Surface,
        request: Request,
        camera: Camera,
        look: Look,
        backdrop: Backdrop | None,
        motion: Motion | None,
        names: tuple[str, ...],
        sample: int = 0,
        trace: Tracer = trace_image,
    ) -> None:
        self._names, self._sample, self._trace_image = names, sample, trace
        self._surface, self._request, self._whole_camera, self._look = surface, request, camera, look
        self._behind = backdrop
        # Where no object is behind, the fluid's passes are whole as they are.
        self._backdrop = backdrop if backdrop is not None and backdrop.names else None
        self._motion = motion
        self._memory = request.memory
        self._sources = look.sources or (FluidSource(material=Material(color=look.color)),)

    def __getitem__(self, name: str) -> FloatArray:
        """A pass by its name."""
        return _MAKERS[name](self)

    @cached_property
    def hit(self) -> BoolArray:
        """(height, width): where fluid or another object shows itself."""
        if self._backdrop is None:
            return self._fluid
        return self._fluid | (self._backdrop.is_seen & ~self._is_before)

    @cached_property
    def objects(self) -> npt.NDArray[np.int32]:
        """(height, width): what is seen, an index into the names of the look's sources and then the backdrop's; -1: nothing."""
        found = self._shown_source
        if self._backdrop is not None:
            others = self.hit & ~self._fluid
            found = found.copy()
            found[others] = self._backdrop.object[others] + len(self._sources)
        return found

    @cached_property
    def _is_before(self) -> BoolArray:
        """Where fluid is nearer than all else, holdouts too."""
        depth = self._surface.depth
        hit = np.less(depth, DEPTH_BACKGROUND, out=self._memory.empty(depth.shape, np.bool_))
        return hit if self._backdrop is None else hit & (depth < self._backdrop.depth)

    @cached_property
    def _fluid(self) -> BoolArray:
        """Where fluid shows itself."""
        holds_out = np.array([source.is_holdout for source in self._sources])
        return self._is_before & ~holds_out[self._source] if holds_out.any() else self._is_before

    @cached_property
    def _is_alone(self) -> bool:
        """Whether all fluid that was found is seen: then what was found has the background of each pass already."""
        return self._backdrop is None and self._fluid is self._is_before

    @cached_property
    def _source(self) -> npt.NDArray[np.int32]:
        """Index of the object that the dominant ball comes from; 0 where there is no fluid."""
        balls, ball = self._request.balls, self._surface.ball
        if len(self._sources) == 1 or balls.sources is None or ball is None or not len(balls):
            return np.broadcast_to(np.int32(0), self._surface.depth.shape)
        return np.asarray(balls.sources[np.maximum(ball, 0)], np.int32)

    @cached_property
    def _shown_source(self) -> npt.NDArray[np.int32]:
        """The same, -1 where no fluid shows itself."""
        shown = self._memory.empty(self._fluid.shape, np.int32)
        shown.fill(-1)
        np.copyto(shown, self._source, where=self._fluid)
        return shown

    def _of_fluid(self, values: FloatArray, name: str) -> FloatArray:
        """The values of fluid that shows itself, else the pass's background."""
        if self._is_alone:
            return values
        shown = self._fluid if values.ndim == 2 else self._fluid[..., None]
        return np.where(shown, values, np.float32(PASSES[name].background))

    def _of_objects(self, name: str, values: FloatArray, behind: Callable[[Backdrop], FloatArray]) -> FloatArray:
        """The values of fluid, and those of other objects where these are seen."""
        image = self._of_fluid(values, name)
        if self._backdrop is not None:
            others = self.hit & ~self._fluid
            image[others] = behind(self._backdrop)[others]
        return image

    @cached_property
    def _depth(self) -> FloatArray:
        return self._of_objects("depth", self._surface.depth, lambda backdrop: backdrop.depth)

    @cached_property
    def _normal(self) -> FloatArray:
        return self._of_objects("normal", self._surface.normal, lambda backdrop: backdrop.normal)

    @cached_property
    def _places(self) -> dict[str, FloatArray]:
        """The passes that follow from where the surface lies, of those that are asked for."""
        request, shape = self._request, self.hit.shape
        images = {name: self._memory.empty((*shape, *_PLACES[name]), np.float32) for name in _PLACES if name in self._names}
        motion = self._motion or Motion(self._whole_camera, self._whole_camera, 0.0)
        core = native.load()
        with native.translated_errors():
            core.place(
                self._depth,
                self._normal,
                None if self._surface.velocity is None else self._of_fluid(self._velocity, "velocity"),
                *self._ways_of_others,
                *(images.get(name) for name in _PLACES),
                background=DEPTH_BACKGROUND,
                view=native.view_tuple(request.camera),
                previous=native.view_tuple(replace(motion.previous, region=self._whole_camera.region).cropped()),
                following=native.view_tuple(replace(motion.following, region=self._whole_camera.region).cropped()),
                seconds=motion.seconds,
                threads=request.threads,
                watch=request.watch,
            )
        return images

    @property
    def _ways_of_others(self) -> tuple[FloatArray | None, FloatArray | None]:
        """(height, width, 3) each: the ways of other objects to where they are one frame before and after; None for none."""
        if self._backdrop is None:
            return None, None
        others = (self.hit & ~self._fluid)[..., None]
        before, after = self._backdrop.to_previous, self._backdrop.to_following
        return (
            None if before is None else np.where(others, before, np.float32(0)),
            None if after is None else np.where(others, after, np.float32(0)),
        )

    @cached_property
    def _color(self) -> FloatArray:
        """Linear Rec.709; the look's colour where the balls have none."""
        if self._surface.color is not None:
            return self._surface.color
        return np.broadcast_to(np.array(self._look.color, np.float32), self._surface.normal.shape)

    @cached_property
    def _velocity(self) -> FloatArray:
        """World space, Blender units a second; 0 where unknown."""
        return np.zeros_like(self._surface.normal) if self._surface.velocity is None else self._surface.velocity

    def _colors(self) -> FloatArray:
        if self._surface.color is not None:
            return self._of_objects("color", self._color, lambda backdrop: backdrop.color)
        colors = np.where(self._surface.hit[..., None], self._color, np.float32(0))
        return self._of_objects("color", colors, lambda backdrop: backdrop.color)

    def _length(self) -> FloatArray:
        request = self._request
        hit = self._surface.hit
        spans = find_spans(request.balls, request.camera, request.field, hit, request.threads, request.watch)
        if self._backdrop is not None:
            spans = spans.before(self._backdrop.depth)
        return self._of_fluid(spans.thickness, "thickness")

    def _object_index(self) -> FloatArray:
        numbers = [source.pass_index for source in self._sources]
        numbers += self._backdrop.pass_indices if self._backdrop is not None else ()
        return self._labelled(self.objects, np.array(numbers, np.float32), 0.0)

    def _ball_id(self) -> FloatArray:
        balls, ball, background = self._request.balls, self._surface.ball, PASSES["ball_id"].background
        if ball is None:
            return np.full(self.hit.shape, background, np.float32)
        table = np.arange(len(balls), dtype=np.float32) if balls.ids is None else balls.ids.astype(np.float32)
        return self._of_fluid(self._labelled(ball, table, background), "ball_id")

    def _cluster_id(self) -> FloatArray:
        request, ball, background = self._request, self._surface.ball, PASSES["cluster_id"].background
        if ball is None:
            return np.full(self.hit.shape, background, np.float32)
        found = number_clusters(request.balls, request.field, threads=request.threads, watch=request.watch)
        return self._of_fluid(self._labelled(ball, found.numbers.astype(np.float32), background), "cluster_id")

    def _labelled(self, index: npt.NDArray[np.int32], table: FloatArray, background: float) -> FloatArray:
        """(height, width): the number in a table that each pixel's index stands for, the background where it is negative."""
        image = self._memory.empty(index.shape, np.float32)
        height, width = index.shape
        core, request = native.load(), self._request
        with native.translated_errors():
            core.label(
                np.ascontiguousarray(index),
                table,
                image,
                background=background,
                width=width,
                height=height,
                threads=request.threads,
                watch=request.watch,
            )
        return image

    @cached_property
    def _combined(self) -> FloatArray:
        """(height, width, 4): the look, with depth contrast, over what is behind."""
        shown, uses_scene = self._fluid, LOOK_STYLES[self._look.style].uses_scene
        rgba = self._memory.empty((*shown.shape, 4), np.float32)
        if self._behind is None:
            behind: Color | None = (0.0, 0.0, 0.0, 0.0)
        else:
            behind = self._behind.color_behind if self._is_alone else None
        tracing = self._look.tracing if uses_scene else None
        if behind is None or tracing is not None or not uses_scene:
            rgba[:] = behind if self._behind is None else self._behind.rgba
        if not self._is_alone:
            rgba[self._is_before & ~shown] = 0
        if tracing is not None:
            self._trace(rgba, tracing)
        elif uses_scene:
            self._shade_materials(rgba, behind)
        elif shown.any():
            balls, camera = self._request.balls, self._request.camera
            ranges = Ranges(camera.depth_range(balls.bounds), (0.0, balls.fastest))
            rgba[shown] = shaded(self._points(shown), self._look, ranges).over(rgba[shown])
        return rgba

    def _shade_materials(self, rgba: FloatArray, behind: Color | None) -> None:
        """Lay the fluid's materials over `rgba`."""
        request, surface = self._request, self._surface
        shade_image(
            rgba,
            surface.depth,
            surface.normal,
            self._color,
            self._shown_source,
            request.camera,
            tuple(source.material for source in self._sources),
            self._look.lighting,
            self._contrast,
            behind=behind,
            threads=request.threads,
            watch=request.watch,
        )

    def _trace(self, rgba: FloatArray, tracing: Tracing) -> None:
        """Trace the light of fluid and meshes that show themselves."""
        request, surface, backdrop = self._request, self._surface, self._backdrop
        materials = tuple(source.material for source in self._sources)
        if request.balls.colors is None:
            materials = tuple(replace(material, color=self._look.color) for material in materials)
        ball = np.full(self.hit.shape, -1, np.int32)
        np.copyto(ball, 0 if surface.ball is None else surface.ball, where=self._fluid)
        material, color = self._shown_source, self._color
        if backdrop is not None and backdrop.material is not None:
            others = self.hit & ~self._fluid
            material = np.where(others, backdrop.material + np.int32(len(materials)), material)
            color = np.where(self._fluid[..., None], color, backdrop.color)
        self._trace_image(
            rgba,
            SeenSurface(self._depth, self._normal, color, material, ball),
            request.camera,
            TracedScene(
                request.balls,
                request.field,
                materials,
                self._look.lighting,
                None if self._behind is None else self._behind.meshes,
            ),
            tracing,
            self._contrast,
            image=self._sample,
            is_film_clear=self._behind is None or self._behind.is_film_clear,
            threads=request.threads,
            watch=request.watch,
        )

    def _points(self, shown: BoolArray) -> SurfacePoints:
        """What is shown, as the look needs it."""
        camera, surface = self._request.camera, self._surface
        to_eye = directions_to_eye(camera, shown)
        return SurfacePoints(
            normal=view_normals(surface.normal[shown], camera),
            to_eye=to_eye,
            up=camera.world_from_view[2, :3].astype(np.float32),
            world_normal=surface.normal[shown],
            base=self._color[shown],
            velocity=self._velocity[shown],
            depth=surface.depth[shown],
            ball=self._ball_id()[shown],
            thickness=self._thickness(shown),
            contrast=np.ones(len(to_eye), np.float32) if self._contrast is None else self._contrast[shown],
        )

    def _thickness(self, shown: BoolArray) -> FloatArray:
        """(count,): the length of the way through the fluid, roughly, where the look needs it."""
        if not LOOK_STYLES[self._look.style].uses_thickness:
            return np.zeros(np.count_nonzero(shown), np.float32)
        camera = self._request.camera
        return at_pixels(thickness_image(self._request.balls, camera, self._request.field), camera, shown)

    @property
    def _contrast(self) -> FloatArray | None:
        """(height, width): the factor by which depth contrast changes the light; None for 1."""
        look = self._look
        if look.depth_contrast == 0:
            return None
        importance = spatial_importance(self._depth, self.hit, self._whole_camera, look.depth_contrast_radius)
        # Small changes are in proportion to the importance, great ones end at nothing and at twice the light: no halo glows.
        return np.asarray(1 + np.tanh(look.depth_contrast * importance), np.float32)


_MAKERS: dict[str, Callable[[PassImages], FloatArray]] = {
    "combined": lambda made: made._combined,
    "depth": lambda made: made._depth,
    "normal": lambda made: made._normal,
    "position": lambda made: made._places["position"],
    "vector": lambda made: made._places["vector"],
    "alpha": lambda made: np.ascontiguousarray(made._combined[..., 3]),
    "facing": lambda made: made._places["facing"],
    "thickness": lambda made: made._length(),
    "object_index": lambda made: made._object_index(),
    "color": lambda made: made._colors(),
    "velocity": lambda made: made._of_fluid(made._velocity, "velocity"),
    "speed": lambda made: made._places["speed"],
    "ball_id": lambda made: made._ball_id(),
    "cluster_id": lambda made: made._cluster_id(),
}
"""How each pass is made."""
