"""What is timed side by side: a method, and for the native core its processor paths on one thread and on all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

NATIVE_METHODS = ("tile_caster",)
"""Methods of the native core, which obeys the variable below."""
SIMD_VARIABLE = "MENISCUS_SIMD"
COMPARED_SCENES = ("random_10k", "random_100k", "dense_120k")
"""Scenes on which every processor path has rows."""


@dataclass(frozen=True)
class Variant:
    """A method as it is run.

    Attributes
    ----------
    method
        Its name in the registry.
    simd
        A processor path; empty leaves the choice to the method.
    threads
        How many may work on the CPU; 0 for one a core.
    switches
        Options of Depth Peeling by name, where they are not its own.
    """

    method: str
    simd: str = ""
    threads: int = 0
    switches: tuple[tuple[str, bool], ...] = ()

    def variables(self) -> dict[str, str]:
        """The environment variables of the process that runs it."""
        return {SIMD_VARIABLE: self.simd} if self.simd else {}


def default_methods(described: dict[str, Any]) -> list[str]:
    """The preferred CPU method, and every GPU method on OpenGL that is hardware."""
    runs = [method for method in described["methods"] if not method["problem"]]
    cpu = [method["name"] for method in runs if method["backend"] == "cpu"]
    return cpu[:1] + [method["name"] for method in runs if method["backend"] == "gpu" and not method["is_software"]]


def variants(scene: str, methods: list[str], simd_paths: list[str]) -> list[Variant]:
    """What is timed on a scene; the first is what the others are compared with."""
    chosen = []
    for method in methods:
        chosen.append(Variant(method))
        if method in NATIVE_METHODS and scene in COMPARED_SCENES:
            chosen += [Variant(method, path, threads) for path in simd_paths for threads in (0, 1)]
    return chosen
