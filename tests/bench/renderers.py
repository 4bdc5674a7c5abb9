"""The processes that render with Meniscus: one for each variant, because the native core reads its variable once."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meniscus import Field

from .report import OUT
from .variants import Variant
from .worker import Worker

COMMAND = (sys.executable, "-m", "bench.render_worker")
PREPARE_LIMIT = 1800.0
"""Seconds to make a scene's balls: the first time a simulation may have to be baked."""


@dataclass(frozen=True)
class Picture:
    """What is rendered: a scene, the size in pixels, and a field where it is not the scene's own."""

    scene: str
    width: int
    height: int
    field: Field | None = None


class Renderers:
    """Starts the processes as they are needed, and ends them with the block."""

    def __init__(self, log_name: str) -> None:
        self._log = OUT / f"{log_name}.log"
        self._workers: dict[Variant, Worker] = {}
        self._scenes: dict[Variant, str] = {}

    def __enter__(self) -> Renderers:
        return self

    def __exit__(self, *reason: object) -> None:
        for worker in self._workers.values():
            worker.stop()

    def describe(self) -> dict[str, Any]:
        """The methods, the processor paths and the OpenGL renderer that there are, see `render_worker.describe`."""
        with Worker(COMMAND, self._log) as worker:
            return worker.ask({"do": "describe"}, PREPARE_LIMIT)

    def render(self, variant: Variant, picture: Picture, limit: float, save: Path | None = None) -> dict[str, Any]:
        """Render once, see `render_worker.render`; CaseError where that fails or takes longer than `limit` seconds."""
        worker = self._workers.setdefault(variant, Worker(COMMAND, self._log, variant.variables()))
        if self._scenes.get(variant) != picture.scene:
            worker.ask({"do": "prepare", "scene": picture.scene}, PREPARE_LIMIT)
            self._scenes[variant] = picture.scene
        how = {"method": variant.method, "threads": variant.threads, "switches": dict(variant.switches)}
        request = {"do": "render", **how, "save": save, **vars(picture)}
        return worker.ask(request, limit)
