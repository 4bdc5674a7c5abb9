"""What the scene around a fluid gives to its look: materials, lights and the colour of the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """A surface as Blender's Principled BSDF describes it, as far as rays that see only the first surface can show it.

    Attributes
    ----------
    color
        Base colour, linear Rec.709; balls with colours of their own take these.
    metallic, roughness, transmission
        Each 0 to 1.
    ior
        Index of refraction.
    emission
        Radiance that the surface gives off, linear Rec.709.
    """

    color: Vector = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 0.5
    transmission: float = 0.0
    ior: float = 1.5
    emission: Vector = (0.0, 0.0, 0.0)


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
        Unit vector: where it shines, along its own -z.
    area
        Of an area light, square units.
    cone
        Of a spot: cosine of half its angle, and the share of the cone over which its border is soft.
    """

    kind: Literal["SUN", "POINT", "SPOT", "AREA"]
    power: Vector
    position: Vector = (0.0, 0.0, 0.0)
    direction: Vector = (0.0, 0.0, -1.0)
    area: float = 0.0
    cone: tuple[float, float] = (0.0, 0.0)


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
    """

    name: str = ""
    pass_index: int = 0
    material: Material = Material()
    is_holdout: bool = False


@dataclass(frozen=True)
class Lighting:
    """Lights, and the radiance that the world sends from everywhere, linear Rec.709."""

    lights: tuple[Light, ...] = ()
    world: Vector = (0.0, 0.0, 0.0)
