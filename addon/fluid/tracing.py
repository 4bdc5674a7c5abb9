"""How far light is followed beyond the first surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .errors import InputError


@dataclass(frozen=True)
class Tracing:
    """Traced light: shadows, reflections, refraction, ambient occlusion.

    Attributes
    ----------
    reflections
        How many mirrors light may meet on its way to the eye, 0 to 64; inner ones count. After the last one, surfaces mirror
        the world and the lights, as if nothing were in the way.
    refractions
        How many times it may enter or leave a body that lets light pass, 0 to 64; a drop of water takes two. After the
        last one the world is seen.
    shadows
        Whether what stands before a light takes it away.
    occlusion_rays
        Rays of each sample that ask how much of the world a point sees, for the light that its matt part has of the world; 0
        where all of it is taken to be seen, at most 4096. Points seen in mirrors take fewer.
    occlusion_distance
        How far they look, Blender units; farther things take no light away. May be infinite.
    samples
        How many times each pixel of one image is sampled, 1 to 65536. The more, the less noise of soft shadows, rough
        surfaces and occlusion.

    Raises
    ------
    InputError
        A number is out of range.
    """

    reflections: int = 3
    refractions: int = 8
    shadows: bool = True
    occlusion_rays: int = 0
    occlusion_distance: float = float("inf")
    samples: int = 1

    @property
    def hurried(self) -> Tracing:
        """The same with less work, for what is seen a moment only: noisier, and light goes less far."""
        return replace(
            self,
            reflections=min(self.reflections, 2),
            refractions=min(self.refractions, 4),
            occlusion_rays=min(self.occlusion_rays, 4),
            samples=1,
        )

    def __post_init__(self) -> None:
        for name, label, least, greatest in _LIMITS:
            value = getattr(self, name)
            if not least <= value <= greatest:
                raise InputError(
                    f"The number of {label} must be from {least} to {greatest}, not {value}: change the traced light"
                )
        if not self.occlusion_distance > 0:
            raise InputError(
                f"The distance of ambient occlusion must be greater than 0, not {self.occlusion_distance}: "
                "to have none, set its rays to 0"
            )


_LIMITS = (
    ("reflections", "reflections", 0, 64),
    ("refractions", "refractions", 0, 64),
    ("occlusion_rays", "occlusion rays", 0, 4096),
    ("samples", "light samples", 1, 65536),
)
