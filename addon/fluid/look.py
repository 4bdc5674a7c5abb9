"""How the surface is coloured in the Combined pass."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Look:
    """A plain headlight: light from the eye, no shadows.

    Attributes
    ----------
    color
        Linear Rec.709 surface colour, used where the balls have no colours of their own.
    ambient
        Share of the light that does not depend on the angle, 0 to 1.
    """

    color: tuple[float, float, float] = (0.06, 0.27, 0.6)
    ambient: float = 0.1
