"""What a peer is."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

Aim = Literal["field", "spheres", "none"]
Product = Literal["mesh", "picture"]


@dataclass(frozen=True)
class Case:
    """A peer with its settings, and what it is compared with.

    Attributes
    ----------
    module
        The peer's file in this folder, without its suffix.
    label
        Its name in the tables.
    kernel, isovalue
        The field that Meniscus renders beside it; it also gives the radius of the kernel spheres.
    aim
        The surface that the peer's is judged by: that of the field, the union of the kernel spheres, or none.
    product
        What it makes; a picture has the size of the one that Meniscus is judged by.
    remark
        What a reader has to know to compare, one sentence.
    options
        For the peer.
    """

    module: str
    label: str
    kernel: str
    isovalue: float
    aim: Aim
    product: Product
    remark: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """What a peer gets. The unit of length is the influence radius R, which all balls share.

    Attributes
    ----------
    positions
        (N, 3) float32.
    kernel_radius, isovalue
        Of a lone ball's surface, and of the field.
    world_from_view
        (4, 4) of a camera that looks along -z.
    field_of_view
        Vertical, radians.
    width, height
        Of the picture, pixels.
    options
        Of the case.
    """

    positions: npt.NDArray[np.float32]
    kernel_radius: float
    isovalue: float
    world_from_view: npt.NDArray[np.float64]
    field_of_view: float
    width: int
    height: int
    options: Mapping[str, Any]


@dataclass(frozen=True)
class Mesh:
    """Triangles: (V, 3) float32 vertices and their unit normals, (T, 3) int32 triangles."""

    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]


class Peer(Protocol):
    """A tool with the balls before it; each module has `create(task)`, which gives one."""

    def surface(self) -> dict[str, float]:
        """Make the surface anew from the positions; milliseconds by stage.

        The stage "hand over" is what it takes to get the positions through the tool's Python interface.
        """
        ...


class MeshPeer(Peer, Protocol):
    """A peer that makes a mesh."""

    def mesh(self) -> Mesh:
        """The surface made last."""
        ...


class PicturePeer(Peer, Protocol):
    """A peer that makes a picture."""

    def save_picture(self, path: str) -> None:
        """Write the picture made last: an OpenEXR file with Blender's names for depth and normal."""
        ...


class Stopwatch:
    """Collects the milliseconds of stages."""

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block."""
        start = time.perf_counter()
        yield
        self.milliseconds[name] = (time.perf_counter() - start) * 1e3
