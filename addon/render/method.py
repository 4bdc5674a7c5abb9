"""What a rendering method is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.field import Field
from ..fluid.view_balls import ViewBalls

Backend = Literal["gpu", "cpu"]


@dataclass(frozen=True)
class MethodInfo:
    """A method as the registry, the interface and the tests know it, without loading it.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    backend
        "gpu" runs through OpenGL, "cpu" without it.
    gl_version
        Least OpenGL version as moderngl writes it (330), 0 on the CPU.
    max_balls
        How many balls may meet the view at once.
    """

    name: str
    label: str
    description: str
    backend: Backend
    gl_version: int = 0
    max_balls: int = 2**31 - 1


@dataclass
class Surface:
    """What a method finds: float32 arrays of the camera's whole image, row 0 at the bottom.

    Attributes
    ----------
    depth
        (height, width): planar distance of the first crossing of the isosurface, infinite where there is none.
    normal
        (height, width, 3): unit, world space, out of the fluid (against the gradient); 0 where there is nothing.
    color
        (height, width, 3): the balls' colours, each weighted by its share of the density there; None where not asked for.
    counts
        What happened, by name.
    """

    depth: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    color: npt.NDArray[np.float32] | None = None
    counts: dict[str, int] = field(default_factory=dict)

    @classmethod
    def empty(cls, camera: Camera, with_color: bool) -> Surface:
        """The surface of nothing, for a method to fill."""
        shape = (camera.height, camera.width)
        color = np.zeros((*shape, 3), np.float32) if with_color else None
        return cls(np.full(shape, np.inf, np.float32), np.zeros((*shape, 3), np.float32), color)


class Method(Protocol):
    """A way to find the surface."""

    @property
    def device(self) -> str:
        """The processor that it runs on, as the user knows it."""
        ...

    def find_surface(
        self, balls: ViewBalls, camera: Camera, field: Field, wants_color: bool, check_cancelled: Callable[[], None]
    ) -> Surface:
        """The first surface along each pixel's ray between the clip distances.

        `camera` has no region. `check_cancelled` raises CancelledError when the user gave up; call it often.
        A ray that starts inside the fluid sees the surface from within.
        """
        ...
