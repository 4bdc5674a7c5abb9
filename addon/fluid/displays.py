"""What stands for the balls in an image."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import InputError

METABALLS = "metaballs"


@dataclass(frozen=True)
class Display:
    """A way to show balls: the identifier, and what the user interface shows."""

    name: str
    label: str
    description: str


DISPLAYS: dict[str, Display] = {
    display.name: display
    for display in (
        Display(METABALLS, "Metaballs", "The blended surface of all balls"),
        Display("spheres", "Spheres", "Each ball as the sphere that it would be alone, with a hard surface"),
        Display("ellipsoids", "Ellipsoids", "Each connected liquid as an ellipsoid of its place, size and direction"),
    )
}


def check_display(name: str) -> None:
    """InputError where there is no such display."""
    if name not in DISPLAYS:
        raise InputError(f"Unknown display '{name}': choose one of {', '.join(DISPLAYS)}")
