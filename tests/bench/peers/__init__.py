"""What users have today, each in a file of its own. A new one is its file and one line here.

These modules run in an environment with the peers but without Meniscus, and are read in one without the peers: they load
nothing but numpy until `create` is called.
"""

from __future__ import annotations

import importlib

from .peer import Case

_MODULES = (
    "metaballs",
    "points_to_volume",
    "splashsurf",
    "cycles_spheres",
)


def cases() -> list[Case]:
    """All cases of all peers, in order."""
    return [case for name in _MODULES for case in importlib.import_module(f"{__name__}.{name}").CASES]
