"""What rendering gives: named float images and a report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .balls import dropped_text
from .camera import Camera
from .cryptomatte import Cryptomatte
from .errors import InputError


@dataclass
class RenderInfo:
    """How an image came about.

    Attributes
    ----------
    method, backend, device
        What rendered it.
    reason
        Why this method and no other, in one sentence.
    milliseconds
        Wall time by stage, in order.
    counts
        Numbers worth knowing: ``balls``, ``balls_drawn``, ``peels``, ``overflows`` ... as the method reports them.
    dropped
        Unusable balls by reason, see :class:`Balls`.
    notes
        Sentences on what is shown otherwise than the scene says, or left out.
    """

    method: str = ""
    backend: str = ""
    device: str = ""
    reason: str = ""
    milliseconds: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def dropped_text(self) -> str:
        """One sentence about balls that were left out, empty where none was."""
        return dropped_text(self.dropped)

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))


@dataclass
class ImageBuffers:
    """The passes of one image: float32, row 0 at the bottom; scalars (height, width), else (height, width, channels).

    Attributes
    ----------
    camera
        What the image shows.
    passes
        The images by pass name, see :data:`passes.PASSES`. Also reachable as ``image["depth"]``.
    hit
        (height, width) bool: where there is a surface.
    info
        How the image came about.
    objects
        (height, width) int32: which object is seen, an index into the look's sources and what else was rendered; -1 for none.
        None where the Object Index pass is not there.
    cryptomatte
        Mattes by object; None where nobody asked for them.
    """

    camera: Camera
    passes: dict[str, npt.NDArray[np.float32]]
    hit: npt.NDArray[np.bool_]
    info: RenderInfo
    objects: npt.NDArray[np.int32] | None = None
    cryptomatte: Cryptomatte | None = None

    def __getitem__(self, name: str) -> npt.NDArray[np.float32]:
        if name not in self.passes:
            raise InputError(f"The image has no pass '{name}', only {', '.join(self.passes)}")
        return self.passes[name]
