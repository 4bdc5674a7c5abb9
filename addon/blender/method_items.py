"""What the user can choose from: methods and back-ends, as enumeration items."""

from __future__ import annotations

BACKENDS = (
    ("auto", "Automatic", "The graphics card where it can, else the processor"),
    ("gpu", "GPU", "The graphics card, through OpenGL"),
    ("cpu", "CPU", "The processor"),
)


def method_items() -> list[tuple[str, str, str]]:
    """Name, label and description of each method, the automatic choice first."""
    methods = (("depth_peeling", "Depth Peeling", "Peels the influence spheres front to back (Kanamori et al. 2008)"),)
    return [("auto", "Automatic", "The fastest method that runs here"), *methods]
