"""What a render knows beside the fluid: what else is seen at each pixel, and how that and the camera move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..fluid.camera import Camera
from ..fluid.meshes import Meshes
from ..fluid.passes import DEPTH_BACKGROUND

FloatArray = npt.NDArray[np.float32]
Color = tuple[float, float, float, float]


@dataclass(frozen=True)
class Backdrop:
    """What is seen at each pixel where no fluid is: arrays of the rendered region, row 0 at the bottom.

    Attributes
    ----------
    rgba
        (height, width, 4): linear Rec.709, premultiplied alpha.
    depth
        (height, width): planar, DEPTH_BACKGROUND where nothing hides the fluid.
    normal
        (height, width, 3): world space, 0 where there is nothing.
    color
        (height, width, 3): base colour, 0 where there is nothing.
    object
        (height, width) int32: index into `pass_indices`, -1 where there is nothing.
    is_holdout
        (height, width): where what hides the fluid is not seen itself, and leaves the background of each pass.
    names, pass_indices
        Of the objects; none where there is no object at all.
    color_behind
        The one colour of `rgba`; None where that differs.
    is_film_clear
        Whether there is nothing behind everything, so that the image is transparent there.
    meshes
        What traced light meets beside the fluid; None where there is nothing.
    material
        (height, width) int32: the materials of these meshes that are seen, -1 where there is nothing; None where no mesh is.
    to_previous, to_following
        (height, width, 3): the ways to the places one frame before and one frame after, world space, 0 where there is nothing;
        None where all stands still or motion was not asked for.
    """

    rgba: FloatArray
    depth: FloatArray
    normal: FloatArray
    color: FloatArray
    object: npt.NDArray[np.int32]
    is_holdout: npt.NDArray[np.bool_]
    names: tuple[str, ...] = ()
    pass_indices: tuple[int, ...] = ()
    color_behind: Color | None = None
    is_film_clear: bool = False
    meshes: Meshes | None = None
    material: npt.NDArray[np.int32] | None = None
    to_previous: FloatArray | None = None
    to_following: FloatArray | None = None

    @classmethod
    def empty(cls, camera: Camera, rgba: Color | FloatArray = (0.0, 0.0, 0.0, 0.0)) -> Backdrop:
        """Nothing but one colour, or (height, width, 4), for a camera without region."""
        shape = camera.height, camera.width
        nothing = np.broadcast_to(np.float32(0), (*shape, 3))
        return cls(
            rgba=np.broadcast_to(np.array(rgba, np.float32), (*shape, 4)),
            depth=np.broadcast_to(np.float32(DEPTH_BACKGROUND), shape),
            normal=nothing,
            color=nothing,
            object=np.broadcast_to(np.int32(-1), shape),
            is_holdout=np.broadcast_to(np.False_, shape),
            color_behind=rgba if isinstance(rgba, tuple) else None,
            is_film_clear=not np.any(np.asarray(rgba)[..., 3]),
        )

    @property
    def is_seen(self) -> npt.NDArray[np.bool_]:
        """(height, width): where there is an object that shows itself."""
        return (self.depth < DEPTH_BACKGROUND) & ~self.is_holdout


@dataclass(frozen=True)
class Motion:
    """What is elsewhere one frame before and one frame after.

    Attributes
    ----------
    previous, following
        The camera.
    seconds
        From one frame to the next.
    previous_vertices, following_vertices
        (V, 3) float32: those of the meshes, world space; None where they are where they are now.
    """

    previous: Camera
    following: Camera
    seconds: float
    previous_vertices: FloatArray | None = None
    following_vertices: FloatArray | None = None
