"""Render: pick a method, find the surface, and make the passes from it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.errors import CancelledError, DeviceError, InputError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers, RenderInfo
from ..fluid.look import Look
from ..fluid.passes import PASSES, checked_passes
from ..fluid.view_balls import ViewBalls, view_balls
from .method import Method, MethodInfo, Surface
from .registry import create_method, method_infos, runs_in_software_opengl
from .shading import headlight

Element = TypeVar("Element", np.float32, np.bool_)

BACKENDS = ("auto", "gpu", "cpu")


def render(
    balls: Balls,
    camera: Camera,
    field: Field,
    method: str = "auto",
    backend: str = "auto",
    passes: Iterable[str] = ("depth", "normal"),
    look: Look | None = None,
    is_cancelled: Callable[[], bool] | None = None,
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

    Returns
    -------
    ImageBuffers of the camera's whole image; outside its region there is background.

    Raises
    ------
    InputError, DeviceError, CancelledError
        Each with one sentence for the user.
    """
    names = checked_passes(passes)
    info, runner = _pick_method(method, backend)
    report = RenderInfo(info.name, info.backend, runner.device, dropped=dict(balls.dropped))
    cropped = camera.cropped()
    with _timed(report, "view"):
        seen = view_balls(balls, cropped, field)
    _check_count(seen, info)
    with _timed(report, "surface"):
        surface = runner.find_surface(seen, cropped, field, "combined" in names, _cancel_check(is_cancelled))
    report.counts = {"balls": len(balls), "balls_drawn": len(seen), **surface.counts}
    with _timed(report, "passes"):
        return _image(surface, camera, names, look or Look(), report)


def _pick_method(method: str, backend: str) -> tuple[MethodInfo, Method]:
    """The method asked for, or the preferred one that runs here on the back-end asked for.

    Left to choose, OpenGL is taken where it is hardware: in software it is slower than the CPU back-end.
    """
    if backend not in BACKENDS:
        raise InputError(f"Unknown back-end '{backend}': choose one of {', '.join(BACKENDS)}")
    if method != "auto":
        info, runner = create_method(method)
        if backend not in ("auto", info.backend):
            raise InputError(f"The method '{method}' runs on the back-end '{info.backend}', not on '{backend}'")
        return info, runner
    problems = []
    for info in method_infos():
        if backend in ("auto", info.backend):
            try:
                if backend == "auto" and runs_in_software_opengl(info):
                    continue
                return create_method(info.name)
            except DeviceError as error:
                problems.append(str(error))
    raise DeviceError(problems[0])


def _check_count(balls: ViewBalls, info: MethodInfo) -> None:
    if len(balls) > info.max_balls:
        raise InputError(
            f"{len(balls)} balls meet the view but {info.label} takes at most {info.max_balls}; "
            "show fewer, or choose another method"
        )


def _cancel_check(is_cancelled: Callable[[], bool] | None) -> Callable[[], None]:
    def check() -> None:
        if is_cancelled is not None and is_cancelled():
            raise CancelledError("The render was cancelled")

    return check


@contextmanager
def _timed(report: RenderInfo, stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    report.milliseconds[stage] = (time.perf_counter() - start) * 1e3


def _image(surface: Surface, camera: Camera, names: tuple[str, ...], look: Look, report: RenderInfo) -> ImageBuffers:
    """Derive the passes of the region and put them into the whole image."""
    hit = np.isfinite(surface.depth)
    cropped = camera.cropped()
    makers: dict[str, Callable[[], npt.NDArray[np.float32]]] = {
        "depth": lambda: surface.depth,
        "normal": lambda: surface.normal,
        "position": lambda: _positions(surface.depth, hit, cropped),
        "combined": lambda: headlight(surface.normal, _world_directions(cropped), surface.color, hit, look),
    }
    images = {}
    for name in names:
        image = makers[name]()
        image[~hit] = PASSES[name].background
        images[name] = _in_whole_image(image, camera, PASSES[name].background)
    return ImageBuffers(camera, images, _in_whole_image(hit, camera, False), report)


def _positions(depth: npt.NDArray[np.float32], hit: npt.NDArray[np.bool_], camera: Camera) -> npt.NDArray[np.float32]:
    """(height, width, 3) world space; anything where there is no hit."""
    origins, directions = camera.view_rays()
    in_view = origins + np.where(hit, depth, 0)[..., None] * directions
    return np.asarray(in_view @ camera.world_from_view[:3, :3].T + camera.eye, np.float32)


def _world_directions(camera: Camera) -> npt.NDArray[np.float64]:
    """(height, width, 3) unit, world space."""
    _, directions = camera.view_rays()
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return directions @ camera.world_from_view[:3, :3].T


def _in_whole_image(image: npt.NDArray[Element], camera: Camera, background: float) -> npt.NDArray[Element]:
    if camera.region is None:
        return image
    region = camera.region
    whole = np.full((camera.height, camera.width, *image.shape[2:]), background, image.dtype)
    whole[region.y_min : region.y_max, region.x_min : region.x_max] = image
    return whole
