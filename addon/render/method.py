"""What a rendering method is."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.displays import METABALLS
from ..fluid.field import Field
from ..fluid.passes import DEPTH_BACKGROUND
from .image_memory import ImageMemory
from .instant import Instant
from .settings import Setting, Value

Backend = Literal["gpu", "cpu"]
Attribute = Literal["color", "velocity", "ball"]

ATTRIBUTES: tuple[Attribute, ...] = ("color", "velocity", "ball")
"""In the order in which they are written."""


@dataclass(frozen=True)
class MethodInfo:
    """A method as the registry, the interface and the tests know it, without loading it.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    backend
        "gpu" runs through OpenGL, "cpu" without it.
    attributes
        What it finds beside depth and normal.
    gl_version
        Least OpenGL version as moderngl writes it (330), 0 on the CPU.
    settings
        What users can set of it.
    any_kernel
        Whether it takes kernels that are no polynomials.
    displays
        What it shows balls as, of :data:`displays.DISPLAYS`.
    """

    name: str
    label: str
    description: str
    backend: Backend
    attributes: frozenset[Attribute]
    gl_version: int = 0
    settings: tuple[Setting, ...] = ()
    any_kernel: bool = False
    displays: frozenset[str] = frozenset({METABALLS})


@dataclass(frozen=True)
class Request:
    """What a method is asked for.

    Attributes
    ----------
    balls, camera, field
        What is seen, from where, and which isosurface of it. The camera has no region.
    attributes
        What is wanted beside depth and normal.
    threads
        How many threads may work on the CPU, 0 for one a core.
    watch
        To be called often with the share of the work that is done, 0 to 1; raises CancelledError when the user gave up.
    memory
        Where images come from.
    settings
        All settings of the method by name, checked, see :class:`settings.Setting`.
    display
        What balls are shown as, one of the method's :attr:`MethodInfo.displays`.
    instant
        When it is, for methods that take something from one image to the next.
    """

    balls: Balls
    camera: Camera
    field: Field
    attributes: frozenset[Attribute]
    threads: int
    watch: Callable[[float], None]
    memory: ImageMemory = dataclasses.field(default_factory=ImageMemory)
    settings: Mapping[str, Value] = dataclasses.field(default_factory=dict)
    display: str = METABALLS
    instant: Instant = dataclasses.field(default_factory=Instant)

    @property
    def known_attributes(self) -> tuple[Attribute, ...]:
        """The attributes that are asked for and that the balls carry, in their order."""
        carried = {"color": self.balls.colors, "velocity": self.balls.velocities, "ball": self.balls}
        return tuple(name for name in ATTRIBUTES if name in self.attributes and carried[name] is not None)


@dataclass
class Surface:
    """What a method finds: arrays of the camera's whole image, row 0 at the bottom.

    Attributes
    ----------
    depth
        (height, width) float32: planar distance of the first crossing of the isosurface, DEPTH_BACKGROUND where there is none.
    normal
        (height, width, 3) float32: unit, world space, out of the fluid (against the gradient); 0 where there is nothing.
    color, velocity
        (height, width, 3) float32: the balls' values, each weighted by its share of the density there, 0 where there is
        nothing; None where not asked for or not known.
    ball
        (height, width) int32: index of the ball with the greatest share, -1 where there is nothing; None where not asked for.
    milliseconds, counts
        Wall time by stage in order, and what happened, by name.
    notes
        Sentences on what users should know of it.
    """

    depth: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    color: npt.NDArray[np.float32] | None = None
    velocity: npt.NDArray[np.float32] | None = None
    ball: npt.NDArray[np.int32] | None = None
    milliseconds: dict[str, float] = dataclasses.field(default_factory=dict)
    counts: dict[str, int] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def background(cls, camera: Camera, attributes: Collection[Attribute] = ()) -> Surface:
        """The surface of nothing, to be filled."""
        shape = camera.height, camera.width
        surface = cls(np.full(shape, DEPTH_BACKGROUND, np.float32), np.zeros((*shape, 3), np.float32))
        if "color" in attributes:
            surface.color = np.zeros((*shape, 3), np.float32)
        if "velocity" in attributes:
            surface.velocity = np.zeros((*shape, 3), np.float32)
        if "ball" in attributes:
            surface.ball = np.full(shape, -1, np.int32)
        return surface

    @property
    def hit(self) -> npt.NDArray[np.bool_]:
        """(height, width): where there is a surface."""
        return self.depth < DEPTH_BACKGROUND


def unfilled_surface(request: Request) -> Surface:
    """A surface in the request's memory, with all that it asks for and the balls carry; the method has to write every pixel."""
    shape = (request.camera.height, request.camera.width)
    balls, attributes, memory = request.balls, request.attributes, request.memory

    def vectors(is_wanted: bool) -> npt.NDArray[np.float32] | None:
        return memory.empty((*shape, 3), np.float32) if is_wanted else None

    return Surface(
        depth=memory.empty(shape, np.float32),
        normal=memory.empty((*shape, 3), np.float32),
        color=vectors("color" in attributes and balls.colors is not None),
        velocity=vectors("velocity" in attributes and balls.velocities is not None),
        ball=memory.empty(shape, np.int32) if "ball" in attributes else None,
    )


class Method(Protocol):
    """A way to find the surface."""

    @property
    def device(self) -> str:
        """The processor that it runs on, as the user knows it."""
        ...

    def find_surface(self, request: Request) -> Surface:
        """The first surface along each pixel's ray between the clip distances.

        A ray that starts inside the fluid sees the surface from within.
        """
        ...


@runtime_checkable
class ProgressiveMethod(Method, Protocol):
    """A method that can show a coarse image early."""

    def find_surfaces(self, request: Request) -> Iterator[Surface]:
        """The same surface several times, from coarse to fine; the last is that of :meth:`find_surface`."""
        ...


class DeviceSurface(Protocol):
    """A surface that stays on the graphics processor.

    Attributes
    ----------
    size
        Width and height, pixels.
    milliseconds, counts, notes
        As in :class:`Surface`.
    """

    size: tuple[int, int]
    milliseconds: dict[str, float]
    counts: dict[str, int]
    notes: tuple[str, ...]

    @property
    def passes(self) -> tuple[str, ...]:
        """What there is of it, in order: depth and normal, then the attributes."""
        ...

    def read_back(self) -> dict[str, npt.NDArray[np.float32]]:
        """The passes as arrays, as in :class:`Surface`; on any thread."""
        ...

    def copy_to_attachments(self) -> None:
        """Copy the passes to the textures of the framebuffer that is bound in the context current on this thread.

        They have 32-bit floats, depth one channel, the others four. DeviceError where the driver refuses.
        """
        ...

    def release(self) -> None:
        """Give the memory back, on any thread; nothing can be copied any more."""
        ...


@runtime_checkable
class DeviceMethod(Method, Protocol):
    """A method that can leave the surface on the graphics processor."""

    @property
    def shares_textures(self) -> bool:
        """Whether another context of the process can use its textures, so that it is worth to leave them there."""
        ...

    def find_surface_on_device(self, request: Request) -> DeviceSurface:
        """The same surface as that of :meth:`find_surface`."""
        ...


@runtime_checkable
class PreparingMethod(Method, Protocol):
    """A method that needs something of the balls that takes time to make."""

    def prepare(self, balls: Balls, field: Field, threads: int) -> None:
        """Begin to make what images of these balls will need, and return at once; what was begun for others is given up."""
        ...


@contextmanager
def timed(milliseconds: dict[str, float], stage: str) -> Iterator[None]:
    """Note how long the block takes as a stage."""
    start = time.perf_counter()
    yield
    milliseconds[stage] = (time.perf_counter() - start) * 1e3
