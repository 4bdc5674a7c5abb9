"""How the surface is coloured in the Combined pass."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import InputError


@dataclass(frozen=True)
class Look:
    """A plain headlight: light from the eye, no shadows.

    Attributes
    ----------
    color
        Linear Rec.709 surface colour, used where the balls have no colours of their own.
    ambient
        Share of the light that does not depend on the angle, 0 to 1.
    depth_contrast
        How strongly what is in front is lightened and what is behind is darkened, where the two meet in the image. The light
        changes by the factor ``1 + tanh(depth_contrast * (G * D - D))`` with the depths D and the blur G of
        :func:`depth_contrast.spatial_importance`. 0 leaves it as it is, 3 is a good start, 100 is the most.
    depth_contrast_radius
        How far from such an edge the light changes: the standard deviation of G, by the height of the whole image, so that
        a small preview looks like the final image. Greater than 0, at most 1.

    Raises
    ------
    InputError
        A number of the depth contrast is unusable.
    """

    color: tuple[float, float, float] = (0.06, 0.27, 0.6)
    ambient: float = 0.1
    depth_contrast: float = 0.0
    depth_contrast_radius: float = 0.04

    def __post_init__(self) -> None:
        if not 0 <= self.depth_contrast <= 100:
            raise InputError(f"The depth contrast must be from 0 (none) to 100, not {self.depth_contrast}")
        if not 0 < self.depth_contrast_radius <= 1:
            raise InputError(
                f"The radius of the depth contrast must be greater than 0 and at most 1 (the image's height), "
                f"not {self.depth_contrast_radius}"
            )
