"""What users can set of surface particles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .settings import Setting, Value

COUNT = Setting(
    "particles",
    "Particles",
    "How many surface particles there are; 0 for as many as the surface asks for, about fifty for a lone ball",
    0,
    0,
    2**20,
)
STEPS = Setting("steps", "Steps", "Steps of repulsion in each frame; more spread the particles more evenly", 10, 0, 100)
CELL_SHARE = Setting(
    "cell_share",
    "Cell Size",
    "Side of the spatial hash's cells by a ball's diameter: smaller ones take longer to fill and more memory, less to read",
    1 / 3,
    0.1,
    1.0,
)
DISPERSES = Setting("disperses", "Dispersion", "Let particles leave dense places for thin ones", True)
FILLS_GAPS = Setting("fills_gaps", "Fill Gaps", "Put particles where there are none nearby, new droplets among these", True)
FOLLOWS = Setting(
    "follows",
    "Follow Frames",
    "Let particles go on from the frame before; else each frame begins anew, and is the same whatever was rendered before",
    True,
)
EXACT = Setting(
    "exact",
    "Exact",
    "Move what the discs show onto the surface in each pixel; else the picture is that of the discs alone, as they blend",
    True,
)

SIMULATION_SETTINGS = (COUNT, STEPS, CELL_SHARE, DISPERSES, FILLS_GAPS)
"""Those that :func:`simulation_options` reads."""

PARTICLE_SETTINGS = (*SIMULATION_SETTINGS, FOLLOWS, EXACT)


def simulation_options(settings: Mapping[str, Value]) -> dict[str, Any]:
    """The arguments of :class:`surface_particles.SurfaceParticles`."""
    names = (STEPS, CELL_SHARE, DISPERSES, FILLS_GAPS)
    return {"count": settings[COUNT.name], **{setting.name: settings[setting.name] for setting in names}}
