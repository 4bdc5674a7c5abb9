"""Render: pick a method, find the surface, and make the passes from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.errors import CancelledError, DeviceError, InputError, MeniscusError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers, RenderInfo
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.passes import PASSES, checked_passes
from .depth_contrast import spatial_importance
from .device_image import DeviceImage
from .method import Attribute, DeviceMethod, DeviceSurface, Method, MethodInfo, ProgressiveMethod, Request, Surface, timed
from .registry import create_method, method_infos
from .shading import Ranges, SurfacePoints, directions_to_eye, shaded, view_normals
from .thickness import at_pixels, thickness_image

Element = TypeVar("Element", np.float32, np.bool_)

BACKENDS = ("auto", "gpu", "cpu")

# What a pass needs beside depth and normal.
_NEEDED: dict[str, Attribute] = {"color": "color", "velocity": "velocity", "ball_id": "ball"}


def render(
    balls: Balls,
    camera: Camera,
    field: Field,
    method: str = "auto",
    backend: str = "auto",
    passes: Iterable[str] = ("depth", "normal"),
    look: Look | None = None,
    is_cancelled: Callable[[], bool] | None = None,
    on_progress: Callable[[float], None] | None = None,
    threads: int = 0,
) -> ImageBuffers:
    """Render the surface of a fluid.

    Parameters
    ----------
    balls, camera, field
        What is seen, from where, and which isosurface of it.
    method, backend
        A method's name, and "gpu" or "cpu"; "auto" takes the best that runs here.
    passes
        Names from :data:`passes.PASSES`.
    look
        Colours of the Combined pass.
    is_cancelled
        Asked again and again while rendering; where it returns True, CancelledError is raised.
    on_progress
        Told now and then the share of the present stage that is done, 0 to 1.
    threads
        How many threads may work on the CPU; 0 for one a core.

    Returns
    -------
    ImageBuffers of the camera's whole image; outside its region there is background.

    Raises
    ------
    InputError, DeviceError, CancelledError
        Each with one sentence for the user.
    """
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, look, is_cancelled, on_progress, threads)
    return shot.image(shot.choice.runner.find_surface(shot.request))


def render_progressively(
    balls: Balls,
    camera: Camera,
    field: Field,
    method: str = "auto",
    backend: str = "auto",
    passes: Iterable[str] = ("depth", "normal"),
    look: Look | None = None,
    is_cancelled: Callable[[], bool] | None = None,
    on_progress: Callable[[float], None] | None = None,
    threads: int = 0,
) -> Iterator[ImageBuffers]:
    """Render the surface of a fluid from coarse to fine.

    The parameters and the errors are those of :func:`render`.

    Yields
    ------
    ImageBuffers of the whole image, each finer than the one before; the last is what :func:`render` returns. A method that
    cannot do so yields that one only.
    """
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, look, is_cancelled, on_progress, threads)
    runner = shot.choice.runner
    if isinstance(runner, ProgressiveMethod):
        yield from map(shot.image, runner.find_surfaces(shot.request))
    else:
        yield shot.image(shot.choice.runner.find_surface(shot.request))


def render_to_show(
    balls: Balls,
    camera: Camera,
    field: Field,
    method: str = "auto",
    backend: str = "auto",
    passes: Iterable[str] = ("depth", "normal"),
    is_cancelled: Callable[[], bool] | None = None,
    threads: int = 0,
    is_read_back: bool = False,
) -> ImageBuffers | DeviceImage:
    """Render the surface of a fluid for Blender to draw.

    The parameters and the errors are those of :func:`render`; `is_read_back` asks for ImageBuffers in any case.

    Returns
    -------
    A DeviceImage where the method runs on an OpenGL that shares its textures with Blender's and the passes can stay there, else
    ImageBuffers.
    """
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, None, is_cancelled, None, threads)
    runner = shot.choice.runner
    can_stay = not is_read_back and camera.region is None and shot.can_stay_on_device
    if can_stay and isinstance(runner, DeviceMethod) and runner.shares_textures:
        return shot.device_image(runner.find_surface_on_device(shot.request))
    return shot.image(runner.find_surface(shot.request))


@dataclass(frozen=True)
class _Shot:
    """One view to be rendered by a method."""

    choice: _Choice
    request: Request
    camera: Camera
    passes: tuple[str, ...]
    look: Look

    @classmethod
    def prepare(
        cls,
        balls: Balls,
        camera: Camera,
        field: Field,
        method: str,
        backend: str,
        passes: Iterable[str],
        look: Look | None,
        is_cancelled: Callable[[], bool] | None,
        on_progress: Callable[[float], None] | None,
        threads: int,
    ) -> _Shot:
        names = checked_passes(passes)
        if threads < 0:
            raise InputError(f"The number of threads must be 0 (one a core) or more, not {threads}")
        look = look or Look()
        needed = {*names, *(LOOK_STYLES[look.style].passes if "combined" in names else ())}
        attributes = frozenset(_NEEDED[name] for name in needed if name in _NEEDED)
        choice = _pick_method(method, backend, attributes)
        watch = _watch(is_cancelled, on_progress)
        request = Request(balls, camera.cropped(), field, attributes, threads, watch)
        return cls(choice, request, camera, names, look)

    @property
    def can_stay_on_device(self) -> bool:
        """Whether the passes are what the method finds, and nothing that is made from it."""
        has_colors = self.request.balls.colors is not None
        return all(name in ("depth", "normal") or (name == "color" and has_colors) for name in self.passes)

    def device_image(self, surface: DeviceSurface) -> DeviceImage:
        """What the method has left on the graphics processor."""
        return DeviceImage(self.camera, surface, self._report(surface))

    def _report(self, surface: Surface | DeviceSurface) -> RenderInfo:
        balls = self.request.balls
        info = self.choice.info
        report = RenderInfo(info.name, info.backend, self.choice.runner.device, self.choice.reason, dropped=dict(balls.dropped))
        report.milliseconds = dict(surface.milliseconds)
        report.counts = {"balls": len(balls), **surface.counts}
        return report

    def image(self, surface: Surface) -> ImageBuffers:
        """The passes of what the method has found."""
        report = self._report(surface)
        with timed(report.milliseconds, "passes"):
            hit = surface.hit
            makers = self._makers(surface, hit)
            images = {name: _in_whole_image(makers[name](), self.camera, PASSES[name].background) for name in self.passes}
            return ImageBuffers(self.camera, images, _in_whole_image(hit, self.camera, False), report)

    def _makers(self, surface: Surface, hit: npt.NDArray[np.bool_]) -> dict[str, Callable[[], npt.NDArray[np.float32]]]:
        """How each pass comes from the surface; all have their background where nothing is hit."""
        camera = self.request.camera
        return {
            "depth": lambda: surface.depth,
            "normal": lambda: surface.normal,
            "position": lambda: _positions(surface.depth, hit, camera),
            "combined": lambda: self._combined(surface, hit),
            "color": lambda: _colors(surface, hit, self.look),
            "velocity": lambda: _velocities(surface),
            "ball_id": lambda: _ball_ids(surface, self.request.balls, hit),
        }

    def _combined(self, surface: Surface, hit: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
        """(height, width, 4): the look, with depth contrast."""
        request, look = self.request, self.look
        rgba = np.zeros((*hit.shape, 4), np.float32)
        if not hit.any():
            return rgba
        ranges = Ranges(request.camera.depth_range(request.balls.bounds), (0.0, request.balls.fastest))
        rgba[hit] = shaded(self._points(surface, hit), look, ranges)
        return rgba

    def _points(self, surface: Surface, hit: npt.NDArray[np.bool_]) -> SurfacePoints:
        """What is hit, as the look needs it."""
        camera, balls = self.request.camera, self.request.balls
        uses_thickness = LOOK_STYLES[self.look.style].uses_thickness
        thickness = thickness_image(balls, camera, self.request.field) if uses_thickness else np.zeros((1, 1), np.float32)
        return SurfacePoints(
            normal=view_normals(surface.normal[hit], camera),
            to_eye=directions_to_eye(camera, hit),
            up=camera.world_from_view[2, :3].astype(np.float32),
            world_normal=surface.normal[hit],
            base=_colors(surface, hit, self.look)[hit],
            velocity=_velocities(surface)[hit],
            depth=surface.depth[hit],
            ball=_ball_ids(surface, balls, hit)[hit],
            thickness=at_pixels(thickness, camera, hit),
            contrast=self._contrast(surface, hit)[hit],
        )

    def _contrast(self, surface: Surface, hit: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
        """(height, width): the factor by which depth contrast changes the light."""
        look = self.look
        if look.depth_contrast == 0:
            return np.ones(hit.shape, np.float32)
        importance = spatial_importance(surface.depth, hit, self.camera, look.depth_contrast_radius)
        # Small changes are in proportion to the importance, great ones end at nothing and at twice the light: no halo glows.
        return np.asarray(1 + np.tanh(look.depth_contrast * importance), np.float32)


@dataclass(frozen=True)
class _Choice:
    """A method that runs, and why it was taken."""

    info: MethodInfo
    runner: Method
    reason: str


def _pick_method(method: str, backend: str, attributes: frozenset[Attribute]) -> _Choice:
    """The method asked for, or the fastest one that runs here on the back-end asked for and finds these attributes."""
    if backend not in BACKENDS:
        raise InputError(f"Unknown back-end '{backend}': choose one of {', '.join(BACKENDS)}")
    if method != "auto":
        return _named_method(method, backend, attributes)
    problems: list[MeniscusError] = []
    for info in method_infos():
        if backend in ("auto", info.backend):
            try:
                if missing := _passes_without(attributes - info.attributes):
                    raise InputError(f"{info.label} cannot make the pass {missing}; leave the method to Meniscus")
                reason = str(problems[0]) if problems else "The fastest method, and it runs here"
                return _Choice(*create_method(info.name), reason)
            except (DeviceError, InputError) as error:
                problems.append(error)
    raise problems[0]


def _named_method(method: str, backend: str, attributes: frozenset[Attribute]) -> _Choice:
    info, runner = create_method(method)
    if backend not in ("auto", info.backend):
        raise InputError(f"The method '{method}' runs on the back-end '{info.backend}', not on '{backend}'")
    if missing := _passes_without(attributes - info.attributes):
        raise InputError(f"The method '{method}' cannot make the pass {missing}; choose another method")
    return _Choice(info, runner, "Chosen in the settings")


def _passes_without(missing: frozenset[Attribute]) -> str:
    """Names of the passes that need one of the attributes, as text."""
    return " and ".join(name for name, attribute in _NEEDED.items() if attribute in missing)


def _watch(is_cancelled: Callable[[], bool] | None, on_progress: Callable[[float], None] | None) -> Callable[[float], None]:
    def watch(progress: float) -> None:
        if is_cancelled is not None and is_cancelled():
            raise CancelledError("The render was cancelled")
        if on_progress is not None:
            on_progress(progress)

    return watch


def _positions(depth: npt.NDArray[np.float32], hit: npt.NDArray[np.bool_], camera: Camera) -> npt.NDArray[np.float32]:
    """(height, width, 3) world space; 0 where there is no hit."""
    origins, directions = camera.view_rays()
    in_view = origins + np.where(hit, depth, 0)[..., None] * directions
    positions = np.asarray(in_view @ camera.world_from_view[:3, :3].T + camera.eye, np.float32)
    positions[~hit] = 0
    return positions


def _colors(surface: Surface, hit: npt.NDArray[np.bool_], look: Look) -> npt.NDArray[np.float32]:
    """(height, width, 3) linear Rec.709; the look's colour where the balls have none, 0 where there is no hit."""
    if surface.color is not None:
        return surface.color
    return np.where(hit[..., None], np.array(look.color, np.float32), np.float32(0))


def _velocities(surface: Surface) -> npt.NDArray[np.float32]:
    """(height, width, 3) world space, Blender units a second; 0 where unknown or where there is no hit."""
    return np.zeros_like(surface.normal) if surface.velocity is None else surface.velocity


def _ball_ids(surface: Surface, balls: Balls, hit: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
    """(height, width): ids of the dominant balls, their indices where they have no ids; the background where there is none."""
    ids = np.full(hit.shape, PASSES["ball_id"].background, np.float32)
    if surface.ball is not None:
        indices = surface.ball[hit]
        ids[hit] = indices if balls.ids is None else balls.ids[indices]
    return ids


def _in_whole_image(image: npt.NDArray[Element], camera: Camera, background: float) -> npt.NDArray[Element]:
    if camera.region is None:
        return image
    region = camera.region
    whole = np.full((camera.height, camera.width, *image.shape[2:]), background, image.dtype)
    whole[region.y_min : region.y_max, region.x_min : region.x_max] = image
    return whole
