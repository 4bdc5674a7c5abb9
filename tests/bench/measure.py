"""Times ways to render on a picture, in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from .renderers import Picture, Renderers
from .timing import Plan, Sample, Statistics, interleave, statistics_by_stage
from .variants import Variant

WHOLE = "render"
"""The stage that is the whole call."""


@dataclass(frozen=True)
class Row:
    """One variant on one picture: milliseconds by stage, and why there are none or no more."""

    picture: Picture
    variant: Variant
    stages: dict[str, Statistics]
    facts: dict[str, Any]
    problem: str


def measure(renderers: Renderers, picture: Picture, chosen: Sequence[Variant], plan: Plan, limit: float) -> list[Row]:
    """Time the variants on a picture in turn."""
    facts: dict[Variant, dict[str, Any]] = {variant: {} for variant in chosen}

    def render(variant: Variant) -> Sample:
        reply = renderers.render(variant, picture, limit)
        milliseconds: Sample = reply.pop("milliseconds")
        facts[variant] = reply
        return milliseconds

    outcomes = interleave({variant: partial(render, variant) for variant in chosen}, plan)
    return [
        Row(picture, variant, statistics_by_stage(outcome), facts[variant], outcome.problem)
        for variant, outcome in outcomes.items()
    ]
