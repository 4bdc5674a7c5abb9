"""What the scene around a fluid gives to its look: materials, lights and the colour of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from .errors import InputError

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A surface as Blender's Principled BSDF describes it, and what it encloses.

    Attributes
    ----------
    color
        Base colour, linear Rec.709; balls with colours of their own take these.
    metallic, roughness, transmission
        Each 0 to 1.
    ior
        Index of refraction, greater than 0; below 1 the inside is the thinner medium.
    emission
        Radiance that the surface gives off, linear Rec.709.
    absorption
        How strongly what is inside takes light of each channel away, per Blender unit: the share ``exp(-absorption * length)``
        remains (Beer's law). Only traced light knows lengths.
    """

    color: Vector = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 0.5
    transmission: float = 0.0
    ior: float = 1.5
    emission: Vector = (0.0, 0.0, 0.0)
    absorption: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Light:
    """A light, world space, with the units of Blender's lights.

    Attributes
    ----------
    kind
        As Blender names it.
    power
        Radiant power by colour channel, linear Rec.709: watts, of a sun watts a square unit.
    position
        Where it is; a sun's does not count.
    direction
        Where it shines, along its own -z; a vector of another length is made a unit vector.
    cone
        Of a spot: cosine of half its angle, and the share of the cone over which its border is soft.
    radius
        Of a point or a spot light, Blender units; of a sun half the angle that it is seen under, radians. Only traced light
        knows it.
    size
        Of an area light: width and height, Blender units.
    right
        Of an area light: along its width, made a unit vector; its height is along ``cross(right, direction)``.
    is_round
        Whether an area light is an ellipse with that width and height; else it is a rectangle.
    casts_shadow
        Whether what stands in its way hides it, where light is traced.

    Raises
    ------
    InputError
        A vector has no length.
    """

    kind: Literal["SUN", "POINT", "SPOT", "AREA"]
    power: Vector
    position: Vector = (0.0, 0.0, 0.0)
    direction: Vector = (0.0, 0.0, -1.0)
    cone: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    right: Vector = (1.0, 0.0, 0.0)
    is_round: bool = False
    casts_shadow: bool = True

    def __post_init__(self) -> None:
        for name in ("direction", "right"):
            # A vector that is a little too short would let surfaces hide themselves.
            x, y, z = getattr(self, name)
            length = math.hypot(x, y, z)
            if not 0 < length < math.inf:
                raise InputError(f"The {name} of a light must be a vector with a length, not {(x, y, z)}: turn the light")
            object.__setattr__(self, name, (x / length, y / length, z / length))

    @property
    def area(self) -> float:
        """Of an area light, square units."""
        return self.size[0] * self.size[1] * (math.pi / 4 if self.is_round else 1.0)


@dataclass(frozen=True, eq=False)
class WorldImage:
    """Light that comes from far away, by its direction; two are the same only where they are one.

    Attributes
    ----------
    pixels
        (H, W, 3) float32, C-contiguous: equirectangular, linear Rec.709, row 0 at the bottom (straight down). As in Blender
        the middle of the image is seen along +x of the image's own space, a quarter of the width is seen along +y, and the
        borders along -x. Between the centres of pixels it is interpolated linearly.
    image_from_world
        The rows of a rotation that turns world-space directions into the image's own space.

    Raises
    ------
    InputError
        The pixels have another shape or type, or are not finite, or the matrix is no rotation.
    """

    pixels: npt.NDArray[np.float32]
    image_from_world: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self) -> None:
        pixels = self.pixels
        if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0 or pixels.dtype != np.float32:
            raise InputError(
                f"An image of the world must be float32 of the shape (H, W, 3), not {pixels.dtype} of {pixels.shape}"
            )
        if not np.isfinite(pixels).all():
            raise InputError("An image of the world has pixels that are not finite: choose another image")
        turn = np.array(self.image_from_world)
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4):
            raise InputError("The rotation of the world's image is none: its rows must be unit vectors at right angles")

    @property
    def mean(self) -> Vector:
        """The mean radiance over all directions."""
        height = len(self.pixels)
        # What a row takes up on the sphere.
        shares = np.cos((np.arange(height) + 0.5) / height * np.pi - np.pi / 2)
        red, green, blue = np.average(self.pixels.mean(axis=1, dtype=np.float64), axis=0, weights=shares).tolist()
        return red, green, blue


@dataclass(frozen=True)
class FluidSource:
    """An object that supplies balls.

    Attributes
    ----------
    name
        Its name.
    pass_index
        The number that it has in the Object Index pass.
    material
        Its first material's.
    is_holdout
        Whether its fluid leaves a hole in the image.
    has_cluster_colors
        Whether its balls take the colours of the connected liquids that they are in.
    """

    name: str = ""
    pass_index: int = 0
    material: Material = Material()
    is_holdout: bool = False
    has_cluster_colors: bool = False


@dataclass(frozen=True)
class Lighting:
    """The light of a scene.

    Attributes
    ----------
    lights
        Its lights.
    world
        Radiance that the world sends from everywhere, linear Rec.709. Where it has an image: that by which light that is not
        traced stands for it, :attr:`WorldImage.mean`.
    image
        What the world sends by direction; None where that is one colour.
    """

    lights: tuple[Light, ...] = ()
    world: Vector = (0.0, 0.0, 0.0)
    image: WorldImage | None = None
