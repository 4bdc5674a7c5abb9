"""Render: pick a method, find the surface, and make the passes from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.displays import METABALLS, check_display
from ..fluid.errors import CancelledError, DeviceError, InputError, MeniscusError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers, RenderInfo
from ..fluid.kernels import PolynomialKernel
from ..fluid.look import LOOK_STYLES, Look
from ..fluid.passes import PASSES, checked_passes
from .cluster_numbers import known_counts
from .device_image import DeviceImage
from .device_tracing import trace_image_on_device
from .image_memory import ImageMemory
from .instant import Instant
from .method import (
    Attribute,
    DeviceMethod,
    DeviceSurface,
    Method,
    MethodInfo,
    PreparingMethod,
    ProgressiveMethod,
    Request,
    Surface,
    timed,
)
from .pass_images import NEEDED, PassImages, needed_attributes
from .registry import create_method, method_infos, runs_in_software_opengl
from .settings import Value, checked_settings
from .surroundings import Backdrop, Motion
from .tracing import Tracer, trace_image

Element = TypeVar("Element", np.float32, np.bool_, np.int32)

BACKENDS = ("auto", "gpu", "cpu")

UNTRACED = "Light is not traced, because it is among metaballs alone: display the balls as metaballs for that"
"""What is noted where light was to be traced among other things."""


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
    backdrop: Backdrop | None = None,
    motion: Motion | None = None,
    memory: ImageMemory | None = None,
    sample: int = 0,
    settings: Mapping[str, Value] | None = None,
    display: str = METABALLS,
    instant: Instant | None = None,
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
    backdrop
        What else is seen at each pixel of the camera's region, and hides the fluid where it is nearer; None for nothing.
    motion
        Of the camera, for the Vector pass; None where it stands still.
    memory
        That of earlier images, used again where nobody holds these any more; None for fresh memory.
    sample
        How many images of this view were made before: traced light has other samples in each, so that their mean has less
        noise.
    settings
        Of the method that is named, by their names, see :class:`method.MethodInfo`; what is left out has its default.
    display
        What balls are shown as, a name from :data:`displays.DISPLAYS`. Light is traced among metaballs alone, and only they
        have a thickness.
    instant
        When it is, so that methods which take something from one image to the next know what came before; None for an image
        that stands for itself.

    Returns
    -------
    ImageBuffers of the camera's whole image; outside its region there is background.

    Raises
    ------
    InputError, DeviceError, CancelledError
        Each with one sentence for the user.
    """
    told = is_cancelled, on_progress
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, look, *told, threads, settings, display)
    shot = replace(shot.at(instant), backdrop=backdrop, motion=motion, sample=sample)
    if memory is not None:
        shot = replace(shot, request=replace(shot.request, memory=memory))
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
    settings: Mapping[str, Value] | None = None,
    display: str = METABALLS,
) -> Iterator[ImageBuffers]:
    """Render the surface of a fluid from coarse to fine.

    The parameters and the errors are those of :func:`render`.

    Yields
    ------
    ImageBuffers of the whole image, each finer than the one before; the last is what :func:`render` returns. A method that
    cannot do so yields that one only.
    """
    told = is_cancelled, on_progress
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, look, *told, threads, settings, display)
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
    look: Look | None = None,
    is_cancelled: Callable[[], bool] | None = None,
    threads: int = 0,
    is_read_back: bool = False,
    backdrop: Backdrop | None = None,
    sample: int = 0,
    settings: Mapping[str, Value] | None = None,
    display: str = METABALLS,
    instant: Instant | None = None,
) -> ImageBuffers | DeviceImage:
    """Render the surface of a fluid for Blender to draw.

    The parameters and the errors are those of :func:`render`; `is_read_back` asks for ImageBuffers in any case.

    Returns
    -------
    A DeviceImage where the method runs on an OpenGL that shares its textures with Blender's and the passes can stay there, else
    ImageBuffers.
    """
    shot = _Shot.prepare(balls, camera, field, method, backend, passes, look, is_cancelled, None, threads, settings, display)
    shot = replace(shot.at(instant), backdrop=backdrop, sample=sample)
    runner = shot.choice.runner
    can_stay = not is_read_back and camera.region is None and shot.can_stay_on_device
    if can_stay and isinstance(runner, DeviceMethod) and runner.shares_textures:
        return shot.device_image(runner.find_surface_on_device(shot.request))
    return shot.image(runner.find_surface(shot.request))


def prepare(balls: Balls, field: Field, method: str, backend: str, threads: int = 0) -> None:
    """Have the method begin to make what images of these balls will need, if it can, and return at once.

    The parameters are those of :func:`render`. Nothing happens where the method cannot run: rendering tells why.
    """
    with suppress(MeniscusError):
        runner = _pick_method(method, backend, frozenset(), field, METABALLS).runner
        if isinstance(runner, PreparingMethod):
            runner.prepare(balls, field, threads)


@dataclass(frozen=True)
class _Shot:
    """One view to be rendered by a method."""

    choice: _Choice
    request: Request
    camera: Camera
    passes: tuple[str, ...]
    look: Look
    notes: tuple[str, ...] = ()
    backdrop: Backdrop | None = None
    motion: Motion | None = None
    sample: int = 0

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
        settings: Mapping[str, Value] | None,
        display: str,
    ) -> _Shot:
        names = checked_passes(passes)
        check_display(display)
        if display != METABALLS and "thickness" in names:
            raise InputError("Only metaballs have the pass thickness: leave it out, or display the balls as metaballs")
        if threads < 0:
            raise InputError(f"The number of threads must be 0 (one a core) or more, not {threads}")
        look = look or Look()
        notes: tuple[str, ...] = ()
        if display != METABALLS and look.tracing is not None:
            look, notes = replace(look, tracing=None), (UNTRACED,)
        attributes = needed_attributes(names, look)
        if any(source.is_holdout for source in look.sources):
            attributes |= {NEEDED["object_index"]}
        traces = look.tracing is not None and LOOK_STYLES[look.style].uses_scene and "combined" in names
        if traces or "thickness" in names:
            _ = field.polynomial_kernel  # tells now what it would tell after the surface is found
        choice = _pick_method(method, backend, attributes, field, display)
        checked = checked_settings(method, choice.info.settings, settings)
        watch = watch_of(is_cancelled, on_progress)
        request = Request(balls, camera.cropped(), field, attributes, threads, watch, settings=checked, display=display)
        return cls(choice, request, camera, names, look, notes)

    def at(self, instant: Instant | None) -> _Shot:
        """The same at some time; None for none."""
        return self if instant is None else replace(self, request=replace(self.request, instant=instant))

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
        report.milliseconds, report.notes = dict(surface.milliseconds), (*self.notes, *surface.notes)
        report.counts = {"balls": len(balls), **surface.counts, **known_counts(balls, self.request.field)}
        if unfinished := surface.counts.get("unfinished"):
            report.notes += (f"{unfinished} pixels were left out because the method reached its limits there; raise these",)
        return report

    def image(self, surface: Surface) -> ImageBuffers:
        """The passes of what the method has found."""
        report = self._report(surface)
        with timed(report.milliseconds, "passes"):
            given = self.request, self.camera, self.look, self.backdrop, self.motion, self.passes, self.sample
            made = PassImages(surface, *given, self.choice.tracer)
            images = {name: _in_whole_image(made[name], self.camera, PASSES[name].background) for name in self.passes}
            objects = _in_whole_image(made.objects, self.camera, -1) if "object_index" in self.passes else None
            report.counts |= known_counts(self.request.balls, self.request.field)
            return ImageBuffers(self.camera, images, _in_whole_image(made.hit, self.camera, False), report, objects)


@dataclass(frozen=True)
class _Choice:
    """A method that runs, and why it was taken."""

    info: MethodInfo
    runner: Method
    reason: str

    @property
    def tracer(self) -> Tracer:
        """What traces light: the graphics processor where the method runs on one, else the native core."""
        is_hardware = self.info.backend == "gpu" and not runs_in_software_opengl(self.info)
        return trace_image_on_device if is_hardware else trace_image


def _pick_method(method: str, backend: str, attributes: frozenset[Attribute], field: Field, display: str) -> _Choice:
    """The method asked for, or the fastest one that runs here on the back-end asked for, finds these attributes, takes the
    field's kernel and shows balls in this way.
    """
    if backend not in BACKENDS:
        raise InputError(f"Unknown back-end '{backend}': choose one of {', '.join(BACKENDS)}")
    if method != "auto":
        return _named_method(method, backend, attributes, field, display)
    problems: list[MeniscusError] = []
    for info in _preferred(backend, display):
        try:
            if missing := _passes_without(attributes - info.attributes):
                raise InputError(f"{info.label} cannot make the pass {missing}; leave the method to Meniscus")
            _check_kernel(info, field)
            reason = str(problems[0]) if problems else "The fastest method, and it runs here"
            return _Choice(*create_method(info.name), reason)
        except (DeviceError, InputError) as error:
            problems.append(error)
    raise problems[0]


def _preferred(backend: str, display: str) -> list[MethodInfo]:
    """The methods for a display on a back-end, the preferred first.

    Without a choice of the back-end those on OpenGL that is only software come last.
    """
    infos = [info for info in method_infos(display) if backend in ("auto", info.backend)]
    return sorted(infos, key=_runs_in_software) if backend == "auto" else infos


def _runs_in_software(info: MethodInfo) -> bool:
    try:
        return runs_in_software_opengl(info)
    except DeviceError:  # told when the method is tried
        return False


def _named_method(method: str, backend: str, attributes: frozenset[Attribute], field: Field, display: str) -> _Choice:
    info, runner = create_method(method)
    if display not in info.displays:
        raise InputError(f"The method '{method}' does not show {display}: leave the method to Meniscus, or change the display")
    if backend not in ("auto", info.backend):
        raise InputError(f"The method '{method}' runs on the back-end '{info.backend}', not on '{backend}'")
    if missing := _passes_without(attributes - info.attributes):
        raise InputError(f"The method '{method}' cannot make the pass {missing}; choose another method")
    _check_kernel(info, field)
    return _Choice(info, runner, "Chosen in the settings")


def _check_kernel(info: MethodInfo, field: Field) -> None:
    kernel = field.density_kernel
    if not (info.any_kernel or isinstance(kernel, PolynomialKernel)):
        others = [f"the method {other.label}" for other in method_infos() if other.any_kernel]
        choices = ", ".join([*others, "another kernel"])
        raise InputError(f"{info.label} cannot draw the kernel {kernel.label}, which is no polynomial; choose {choices}")


def _passes_without(missing: frozenset[Attribute]) -> str:
    """Names of the passes that need one of the attributes, as text."""
    return " and ".join(name for name, attribute in NEEDED.items() if attribute in missing)


def watch_of(is_cancelled: Callable[[], bool] | None, on_progress: Callable[[float], None] | None) -> Callable[[float], None]:
    """What methods call, see :class:`method.Request`."""

    def watch(progress: float) -> None:
        if is_cancelled is not None and is_cancelled():
            raise CancelledError("The render was cancelled")
        if on_progress is not None:
            on_progress(progress)

    return watch


def _in_whole_image(image: npt.NDArray[Element], camera: Camera, background: float) -> npt.NDArray[Element]:
    if camera.region is None:
        return image
    region = camera.region
    whole = np.full((camera.height, camera.width, *image.shape[2:]), background, image.dtype)
    whole[region.y_min : region.y_max, region.x_min : region.x_max] = image
    return whole
