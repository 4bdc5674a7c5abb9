"""The passes: named images, with the names and channels that Blender gives them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .errors import InputError


@dataclass(frozen=True)
class Pass:
    """A named image.

    Attributes
    ----------
    name
        As in the Python interface.
    blender_name, channels
        As in Blender's multilayer files: ``ViewLayer.<blender_name>.<channel>``.
    background
        Value of every channel where there is no surface.
    is_color
        Colour (stored as half floats, colour managed) rather than data (stored as floats).
    is_antialiased
        Whether it is the mean of a pixel's samples; else it is what the ray through the pixel's centre meets.
    """

    name: str
    blender_name: str
    channels: str
    background: float
    is_color: bool
    description: str
    is_antialiased: bool = False


DEPTH_BACKGROUND = 1e10
"""What Cycles writes into the Depth pass where there is nothing."""

PASSES: dict[str, Pass] = {
    image_pass.name: image_pass
    for image_pass in (
        Pass(
            "combined",
            "Combined",
            "RGBA",
            0.0,
            True,
            "The surface as the look shades it, premultiplied alpha",
            is_antialiased=True,
        ),
        Pass("depth", "Depth", "Z", DEPTH_BACKGROUND, False, "Planar distance from the camera, Blender units"),
        Pass("normal", "Normal", "XYZ", 0.0, False, "Unit normal that points out of the fluid, world space"),
        Pass("position", "Position", "XYZ", 0.0, False, "Position of the surface, world space"),
        Pass("vector", "Vector", "XYZW", 0.0, False, "Motion in the image from the previous frame and to the next one, pixels"),
        Pass("alpha", "Alpha", "X", 0.0, False, "How much of a pixel is covered", is_antialiased=True),
        Pass(
            "facing", "Facing", "X", 0.0, False, "Cosine between normal and line of sight: 1 where the surface faces the camera"
        ),
        Pass("thickness", "Thickness", "X", 0.0, False, "Length of the ray in the fluid, Blender units"),
        Pass("object_index", "Object Index", "X", 0.0, False, "Pass index of the object that supplies the ball"),
        Pass("color", "Color", "RGB", 0.0, True, "Blended colour of the balls, before any light"),
        Pass("velocity", "Velocity", "XYZ", 0.0, False, "Blended velocity of the balls, world space, Blender units a second"),
        Pass("speed", "Speed", "X", 0.0, False, "Length of the velocity, Blender units a second"),
        Pass("ball_id", "Ball ID", "X", -1.0, False, "Id, else index, of the ball with the greatest share of the density"),
        Pass(
            "cluster_id",
            "Cluster ID",
            "X",
            -1.0,
            False,
            "Number of the connected liquid, 1 for that of the most balls, 0 where the greatest share has a ball of none",
        ),
    )
}


def checked_passes(names: Iterable[str]) -> tuple[str, ...]:
    """`names` without repetition, in the order given; InputError names the first that is unknown."""
    wanted = tuple(dict.fromkeys(names))
    for name in wanted:
        if name not in PASSES:
            raise InputError(f"Unknown pass '{name}': choose from {', '.join(PASSES)}")
    if not wanted:
        raise InputError(f"No pass was asked for: choose from {', '.join(PASSES)}")
    return wanted
