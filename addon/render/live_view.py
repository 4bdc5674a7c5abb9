"""Live images of a fluid: coarse while something changes, then at full resolution, then antialiased.

One thread renders for all viewports, so that they do not compete for the processor. What each shows next is decided anew
after every image: a view that has none yet comes first, and the newest view that was asked for is the only one that counts.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition, Thread

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.displays import METABALLS
from ..fluid.errors import CancelledError, MeniscusError
from ..fluid.field import Field
from ..fluid.image import ImageBuffers
from ..fluid.look import Look
from .backdrop import Surroundings
from .cluster_numbers import colored_by_cluster, number_clusters
from .depth_contrast import spatial_importance
from .device_image import DeviceImage
from .instant import Instant, Sequence
from .method import timed
from .method_choice import MethodChoice
from .pace import Pace
from .renderer import prepare, render_to_show, watch_of
from .samples import sample_offset
from .thickness import thickness_image

SETTLE_SECONDS = 0.06
"""How long a view must stay the same before it is refined: longer than from one image to the next while it moves."""

_BYTES_PER_CHANNEL = 4

Render = Callable[..., ImageBuffers | DeviceImage]
Prepare = Callable[[Balls, Field, str, str, int], None]


@dataclass(frozen=True, eq=False)
class View:
    """What is to be seen.

    Attributes
    ----------
    balls, camera, field
        As for :func:`renderer.render`; the camera has the full resolution and no region.
    passes
        What is needed of the surface.
    uses_thickness
        Whether the length of the way through the fluid is needed.
    contrast_radius
        Of the depth contrast, see :class:`look.Look`; None where there is none.
    look
        Colours and light of the Combined pass; None where it is not among the passes.
    surroundings
        What else there is in the scene; None where the look knows nothing of that.
    cluster_sources
        Whose balls take the colours of clusters, see :func:`cluster_numbers.colored_by_cluster`; the balls have colours then.
    counts_clusters
        Whether the reports of images count the clusters.
    choice
        Of the method; what it has to hold a pace with counts while views change.
    display, threads
        As for :func:`renderer.render`.
    seconds
        When it is, by the clock of the scene; None for a view that stands for itself.
    samples
        How many samples a pixel gets at last, 1 for no antialiasing.
    frame_rate
        Images a second to hold while views change.
    memory_limit
        Bytes that the samples may take together; there is always one.
    """

    balls: Balls
    camera: Camera
    field: Field
    passes: tuple[str, ...] = ("depth", "normal")
    uses_thickness: bool = False
    contrast_radius: float | None = None
    look: Look | None = None
    surroundings: Surroundings | None = None
    cluster_sources: tuple[int, ...] = ()
    counts_clusters: bool = False
    display: str = METABALLS
    choice: MethodChoice = MethodChoice()
    threads: int = 0
    seconds: float | None = None
    samples: int = 8
    frame_rate: float = 24.0
    memory_limit: int = 512 << 20

    def shows_the_same(self, other: View | None) -> bool:
        """Whether images of the other view are images of this one."""
        return (
            other is not None
            and self.balls is other.balls
            and self.camera.is_same(other.camera)
            and self._means() == other._means()
        )

    def _means(self) -> tuple[object, ...]:
        return (
            *(self.field, self.passes, self.uses_thickness, self.contrast_radius, self.look, self.surroundings),
            *(self.cluster_sources, self.counts_clusters, self.display, self.choice),
        )

    @property
    def hurries(self) -> bool:
        """Whether what is shown while views change is another picture than what rests."""
        return self.look_while_moving != self.look or self.choice != self.choice.unhurried

    @property
    def look_while_moving(self) -> Look | None:
        """The look of what is shown while views change: light is followed less far, so that images stay large."""
        if self.look is None or self.look.tracing is None:
            return self.look
        return replace(self.look, tracing=self.look.tracing.hurried)

    @property
    def most_pictures(self) -> int:
        """How many samples fit into the memory."""
        known = {"depth": 1, "ball_id": 1, "cluster_id": 1, "combined": 4}
        channels = sum(known.get(name, 3) for name in self.passes)
        each = self.camera.width * self.camera.height * channels * _BYTES_PER_CHANNEL
        return max(1, min(self.samples, self.memory_limit // each))


@dataclass(frozen=True, eq=False)
class Picture:
    """An image of a view.

    Attributes
    ----------
    image
        Depth, normal and what else the view asks for; its camera has the size of the image.
    view
        What it shows.
    is_hurried
        Whether it has the look of what moves, and that is another one.
    importance
        (height, width) of the image, see :func:`depth_contrast.spatial_importance`; None where it is not needed.
    thickness
        (height, width) at a resolution of its own, see :func:`thickness.thickness_image`; None where it is not needed.
    depth_range
        The least and the greatest planar depth at which there can be fluid, Blender units.
    speed_range
        0 and the speed of the fastest ball, Blender units a second.
    """

    image: ImageBuffers | DeviceImage
    view: View
    is_hurried: bool = False
    importance: npt.NDArray[np.float32] | None = None
    thickness: npt.NDArray[np.float32] | None = None

    @property
    def depth_range(self) -> tuple[float, float]:
        return self.image.camera.depth_range(self.view.balls.bounds)

    @property
    def speed_range(self) -> tuple[float, float]:
        return 0.0, self.view.balls.fastest


class LiveView:
    """What one viewport shows. Made by :meth:`LiveRenderer.open`; methods may be called from any thread.

    Attributes
    ----------
    revision
        A number that changes whenever there is something new to draw.
    """

    def __init__(self, changed: Condition, prepare: Prepare) -> None:
        self._changed = changed
        self._prepare = prepare
        self._pace = Pace()
        self._view: View | None = None
        self._asked_at = 0.0
        self._pictures: list[Picture] = []
        self._failure: BaseException | None = None
        self._sequence = Sequence()
        self.revision = 0

    def show(self, view: View) -> None:
        """Ask for images of a view; what was asked for before is given up."""
        with self._changed:
            # Without pictures nothing may be loaded yet, and that would take time.
            is_next = bool(self._pictures) and self._view is not None and view.balls is not self._view.balls
            if view.shows_the_same(self._view):
                self._view = view
            else:
                self._view, self._failure, self._asked_at = view, None, time.monotonic()
            self._changed.notify_all()
        # A tree is made of the balls that are rendered, and those with the colours of clusters are still to be made.
        if is_next and not view.cluster_sources and view.display == METABALLS:
            # The thread may still draw what was asked for before.
            self._prepare(view.balls, view.field, view.choice.method, view.choice.backend, view.threads)

    def wait(self, seconds: float) -> bool:
        """Wait until there is a picture of the view that was asked for last, or a failure; whether that came in time."""
        with self._changed:
            return self._changed.wait_for(self._is_answered, seconds)

    def note_presenting(self, picture: Picture, seconds: float) -> None:
        """To bring a picture to the screen took so long; the size of the next ones depends on it."""
        camera = picture.image.camera
        with self._changed:
            self._pace.note_presenting(camera.width * camera.height, seconds)

    @property
    def pictures(self) -> list[Picture]:
        """The newest samples, all of one view and one size; the first looks through the centres of the pixels."""
        with self._changed:
            return self._pictures[: self._view.most_pictures] if self._view is not None else []

    @property
    def failure(self) -> tuple[str, str] | None:
        """What went wrong with the view that was asked for: a sentence, and the traceback of what nobody expected."""
        with self._changed:
            failure = self._failure
        if failure is None:
            return None
        if isinstance(failure, MeniscusError):
            return str(failure), ""
        return f"Meniscus failed unexpectedly ({failure}): please report it", "".join(traceback.format_exception(failure))

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing more will come unless another view is asked for."""
        with self._changed:
            return self._stage() is None

    def _is_current(self) -> bool:
        return bool(self._pictures) and self._view is not None and self._view.shows_the_same(self._pictures[0].view)

    def _is_answered(self) -> bool:
        return self._failure is not None or self._is_current()

    def _stage(self) -> int | None:
        """How far the view is: 0 without a picture, 1 with a coarse one, then the number of samples plus 1; None: finished."""
        if self._view is None or self._failure is not None:
            return None
        if not self._is_current():
            return 0
        if self._is_coarse:
            return 1
        return len(self._pictures) + 1 if len(self._pictures) < self._view.most_pictures else None

    @property
    def _is_coarse(self) -> bool:
        """Whether what is shown is to be replaced when the view rests."""
        assert self._view is not None
        first = self._pictures[0]
        return first.is_hurried or first.image.camera.width < self._view.camera.width

    def _due(self) -> float:
        """When the next picture should be begun, by the monotonic clock."""
        return self._asked_at if self._stage() == 0 else self._asked_at + SETTLE_SECONDS

    def _next_camera(self) -> Camera:
        """What the next picture looks through."""
        assert self._view is not None
        camera = self._view.camera
        if self._stage() == 0:
            return camera.resized(*self._pace.size(camera.width, camera.height, 1.0 / self._view.frame_rate))
        return camera.shifted(*sample_offset(self._next_sample()))

    def _next_sample(self) -> int:
        """The number of the sample that the next picture is."""
        return len(self._pictures) if (self._stage() or 0) > 1 else 0

    def _accept(self, picture: Picture, seconds: float) -> None:
        camera = picture.image.camera
        if picture.is_hurried or not picture.view.hurries:
            self._pace.note(camera.width * camera.height, seconds)
        is_next = self._is_current() and not picture.is_hurried and not self._is_coarse
        self._pictures = [*self._pictures, picture] if is_next else [picture]
        self.revision += 1

    def _fail(self, failure: BaseException) -> None:
        self._failure = failure
        self.revision += 1


class LiveRenderer:
    """The thread that renders for all live views.

    Parameters
    ----------
    render
        What makes an image, as :func:`renderer.render_to_show`.
    prepare
        What begins to make ready for the next balls, as :func:`renderer.prepare`.
    """

    def __init__(self, render: Render = render_to_show, prepare: Prepare = prepare) -> None:
        self._render, self._prepare = render, prepare
        self._changed = Condition()
        self._views: list[LiveView] = []
        self._is_closed = False
        self._thread = Thread(target=self._work, name="meniscus-live", daemon=True)
        self._thread.start()

    def open(self) -> LiveView:
        """A new live view."""
        with self._changed:
            self._views.append(LiveView(self._changed, self._prepare))
            return self._views[-1]

    def drop(self, live: LiveView) -> None:
        """Render no more for a live view."""
        with self._changed:
            self._views.remove(live)
            self._changed.notify_all()

    def close(self) -> None:
        """End the thread, and wait for it."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                live = self._next()
                if live is None:
                    return
                view, camera, sample, stage = live._view, live._next_camera(), live._next_sample(), live._stage()
            assert view is not None
            self._make_picture(live, view, camera, sample, is_first=stage == 0)

    def _next(self) -> LiveView | None:
        """The live view whose turn it is, once there is one; None when the thread is to end."""
        while not self._is_closed:
            pending = [live for live in self._views if live._stage() is not None]
            now = time.monotonic()
            due = [live for live in pending if live._due() <= now]
            if due:
                return min(due, key=lambda live: (live._stage(), live._asked_at))
            self._changed.wait(min(live._due() for live in pending) - now if pending else None)
        return None

    def _make_picture(self, live: LiveView, view: View, camera: Camera, sample: int, is_first: bool) -> None:
        # A first picture is finished whatever comes: else a viewport that changes all the time would show nothing.
        is_cancelled = (lambda: self._is_closed) if is_first else lambda: self._is_overtaken(live, view)
        look, choice = (view.look_while_moving, view.choice) if is_first else (view.look, view.choice.unhurried)
        milliseconds: dict[str, float] = {}
        try:
            # It takes as long for small images: the pace knows nothing of it.
            balls = _balls(view, watch_of(is_cancelled, None))
            with timed(milliseconds, "picture"):
                image = self._render(
                    balls,
                    camera,
                    view.field,
                    **choice.options,
                    passes=view.passes,
                    look=look,
                    is_cancelled=is_cancelled,
                    threads=view.threads,
                    is_read_back=view.contrast_radius is not None,
                    backdrop=None
                    if view.surroundings is None
                    else view.surroundings.backdrop(camera, view.threads, watch_of(is_cancelled, None)),
                    sample=sample,
                    display=view.display,
                    instant=Instant(view.seconds, live._sequence),
                )
                picture = _picture(image, view, is_hurried=is_first and view.hurries)
        except CancelledError:
            return
        except Exception as failure:  # noqa: BLE001 - whatever it is, the user sees it and the thread goes on
            with self._changed:
                if view.shows_the_same(live._view):
                    live._fail(failure)
                    self._changed.notify_all()
            return
        with self._changed:
            if is_first or view.shows_the_same(live._view):
                live._accept(picture, milliseconds["picture"] / 1e3)
                self._changed.notify_all()

    def _is_overtaken(self, live: LiveView, view: View) -> bool:
        """Whether something more urgent waits than to refine this view."""
        with self._changed:
            return (
                self._is_closed
                or live not in self._views
                or not view.shows_the_same(live._view)
                or any(other._stage() == 0 for other in self._views)
            )


def _balls(view: View, watch: Callable[[float], None]) -> Balls:
    """The balls of a view as they are rendered; their clusters are known if the view wants to count them."""
    if view.cluster_sources:
        return colored_by_cluster(view.balls, view.field, view.cluster_sources, threads=view.threads, watch=watch)
    if view.counts_clusters:
        number_clusters(view.balls, view.field, threads=view.threads, watch=watch)
    return view.balls


def _picture(image: ImageBuffers | DeviceImage, view: View, is_hurried: bool) -> Picture:
    """An image with what the look needs beside it."""
    importance = thickness = None
    if view.contrast_radius is not None and isinstance(image, ImageBuffers):
        importance = spatial_importance(image["depth"], image.hit, image.camera, view.contrast_radius)
    if view.uses_thickness:
        thickness = thickness_image(view.balls, image.camera, view.field)
    return Picture(image, view, is_hurried, importance, thickness)
