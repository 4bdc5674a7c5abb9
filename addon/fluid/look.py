"""How the surface is coloured: in the viewport and in the Combined pass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .errors import InputError
from .lighting import FluidSource, Lighting
from .tracing import Tracing


@dataclass(frozen=True)
class LookStyle:
    """A way to colour the surface.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows.
    passes
        What it needs of the surface beside depth and normal, by pass name.
    uses_thickness
        Whether it needs the length of the way through the fluid.
    is_lit
        Whether there is light, and with it depth contrast.
    is_data
        Whether its colours stand for numbers, so that no view transform may change them.
    uses_scene
        Whether it shows materials in the light of the scene, which only the processor shades.
    """

    name: str
    label: str
    description: str
    passes: tuple[str, ...] = ()
    uses_thickness: bool = False
    is_lit: bool = False
    is_data: bool = False
    uses_scene: bool = False


LOOK_STYLES: dict[str, LookStyle] = {
    style.name: style
    for style in (
        LookStyle("studio", "Studio", "Key, fill and rim light that turn with the view", ("color",), is_lit=True),
        LookStyle(
            "water",
            "Water",
            "Reflects a sky, and takes light of what is behind it away by its thickness",
            ("color",),
            uses_thickness=True,
            is_lit=True,
        ),
        LookStyle(
            "material",
            "Materials",
            "The materials of the sources in the light of the scene, as renders show them",
            ("color", "ball_id"),
            is_lit=True,
            uses_scene=True,
        ),
        LookStyle("headlight", "Headlight", "Light from the eye, for measuring and for plain prints", ("color",), is_lit=True),
        LookStyle("flat", "Flat", "The colour of the balls, without light", ("color",)),
        LookStyle("normal", "Normal", "The direction of the surface as a colour, in world space", is_data=True),
        LookStyle("depth", "Depth", "Light where the surface is near, dark where it is far", is_data=True),
        LookStyle("speed", "Speed", "The speed of the balls as a colour map", ("velocity",), is_data=True),
        LookStyle("id", "ID", "A colour for each ball, which it keeps over time", ("ball_id",), is_data=True),
    )
}


SPEED_COLORS = ((0.011, 0.016, 0.133), (0.014, 0.133, 0.456), (0.033, 0.448, 0.342), (0.521, 0.730, 0.102), (1.0, 0.93, 0.52))
"""From slow to fast at even steps, linear Rec.709; each is lighter than the one before."""


def look_constants() -> dict[str, object]:
    """What shaders know of the looks by name: the number of each style, and the colours of speeds."""
    styles = {f"STYLE_{name.upper()}": number for number, name in enumerate(LOOK_STYLES)}
    return styles | {f"SPEED_{number}": f"vec3{color}" for number, color in enumerate(SPEED_COLORS)}


@dataclass(frozen=True)
class Look:
    """Colour and light of the surface.

    Attributes
    ----------
    style
        A name from :data:`LOOK_STYLES`.
    color
        Linear Rec.709 surface colour, used where the balls have no colours of their own.
    ambient
        Share of the light that does not depend on the angle, 0 to 1 (studio, headlight).
    roughness
        0 is a mirror, 1 is dull (studio, water).
    metallic
        1 is metal, which reflects in its own colour and has no other (studio).
    light
        (3,) vector towards the key light, in view space: x to the right, y up, z to the eye (studio, water).
    light_strength
        Factor of all light (studio, water).
    absorption
        How strongly a Blender unit of fluid takes light away (water): the share ``exp(-absorption)`` of a colour channel
        at 0 remains, a channel at 1 loses nothing.
    ior
        Index of refraction (water).
    speed_range
        Speeds at the two ends of the colour map, Blender units a second (speed); None for 0 and the fastest ball.
    depth_contrast
        How strongly what is in front is lightened and what is behind is darkened, where the two meet in the image. The light
        changes by the factor ``1 + tanh(depth_contrast * (G * D - D))`` with the depths D and the blur G of
        :func:`depth_contrast.spatial_importance`. 0 leaves it as it is, 3 is a good start, 100 is the most.
    depth_contrast_radius
        How far from such an edge the light changes: the standard deviation of G, by the height of the whole image, so that
        a small preview looks like the final image. Greater than 0, at most 1.
    sources
        The objects that supply balls, by their index in :attr:`balls.Balls.sources`; none where nothing is known of them.
    lighting
        The light of the scene (material).
    tracing
        How light is followed beyond the first surface (material); None where it ends there.

    Raises
    ------
    InputError
        The style is unknown, or a number is unusable.
    """

    style: str = "studio"
    color: tuple[float, float, float] = (0.06, 0.27, 0.6)
    ambient: float = 0.1
    roughness: float = 0.2
    metallic: float = 0.0
    light: tuple[float, float, float] = (-0.4, 0.6, 0.693)
    light_strength: float = 1.0
    absorption: float = 2.0
    ior: float = 1.33
    speed_range: tuple[float, float] | None = None
    depth_contrast: float = 0.0
    depth_contrast_radius: float = 0.04
    sources: tuple[FluidSource, ...] = ()
    lighting: Lighting = Lighting()
    tracing: Tracing | None = None

    def __post_init__(self) -> None:
        if self.style not in LOOK_STYLES:
            raise InputError(f"Unknown look '{self.style}': choose from {', '.join(LOOK_STYLES)}")
        if not (np.isfinite(self.light).all() and np.any(self.light)):
            raise InputError("The direction of the light must not be zero: turn the light in the look's settings")
        for name, least, greatest in _LIMITS:
            if not least <= getattr(self, name) <= greatest:
                label = name.replace("_", " ")
                raise InputError(f"The {label} of the look must be from {least:g} to {greatest:g}, not {getattr(self, name)}")
        if self.speed_range is not None and not 0 <= self.speed_range[0] < self.speed_range[1] < math.inf:
            raise InputError("The lower end of the speeds must be less than the upper one: change the range of the speeds")
        if not 0 <= self.depth_contrast <= 100:
            raise InputError(f"The depth contrast must be from 0 (none) to 100, not {self.depth_contrast}")
        if not 0 < self.depth_contrast_radius <= 1:
            raise InputError(
                f"The radius of the depth contrast must be greater than 0 and at most 1 (the image's height), "
                f"not {self.depth_contrast_radius}"
            )

    @property
    def light_direction(self) -> tuple[float, float, float]:
        """Unit vector towards the key light, in view space."""
        x, y, z = np.asarray(self.light, np.float64) / np.linalg.norm(self.light)
        return float(x), float(y), float(z)


_LIMITS = (
    ("ambient", 0.0, 1.0),
    ("roughness", 0.0, 1.0),
    ("metallic", 0.0, 1.0),
    ("light_strength", 0.0, 1e6),
    ("absorption", 0.0, 1e6),
    ("ior", 1.0, 10.0),
)
