"""Repeats what is compared in turn, so that a drift of the machine hits all of it alike, and sums up the times."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

Sample = dict[str, float]
"""Milliseconds by stage."""

Case = TypeVar("Case", bound=Hashable)

ALL = "all"
"""The stage that is all of it."""

WARM_UPS = 1
"""Rounds that are left out of the statistics, where others were made."""


class CaseError(Exception):
    """A case could not be measured: one clause that says why."""


@dataclass(frozen=True)
class Plan:
    """How often to measure.

    Attributes
    ----------
    repeats
        Measured rounds, after the warm-up.
    budget
        Seconds of measured rounds after which no further one begins; the warm-up may have to make the scene first.
    """

    repeats: int = 9
    budget: float = 60.0


@dataclass
class Outcome:
    """What came of a case: its samples, and why there are no more where it failed."""

    samples: list[Sample] = field(default_factory=list)
    problem: str = ""

    def measured(self) -> list[Sample]:
        """The samples that count."""
        return self.samples[WARM_UPS:] or self.samples


@dataclass(frozen=True)
class Statistics:
    """Of one stage, milliseconds."""

    median: float
    low_quartile: float
    high_quartile: float
    least: float
    greatest: float
    count: int


def statistics(values: list[float]) -> Statistics:
    """Sum up at least one value."""
    least, low, median, high, greatest = (float(value) for value in np.percentile(values, [0, 25, 50, 75, 100]))
    return Statistics(median, low, high, least, greatest, len(values))


def statistics_by_stage(outcome: Outcome) -> dict[str, Statistics]:
    """Of every stage that any counted sample has, in order."""
    samples = outcome.measured()
    stages = list(dict.fromkeys(stage for sample in samples for stage in sample))
    return {stage: statistics([sample[stage] for sample in samples if stage in sample]) for stage in stages}


def timed(action: Callable[[], object]) -> Callable[[], Sample]:
    """Does something, and tells how long the whole of it took."""

    def measure() -> Sample:
        start = time.perf_counter()
        action()
        return {ALL: 1e3 * (time.perf_counter() - start)}

    return measure


def repeated(action: Callable[[], object], plan: Plan) -> Statistics:
    """Do something several times."""
    return statistics_by_stage(interleave({"": timed(action)}, plan)[""])[ALL]


def interleave(cases: Mapping[Case, Callable[[], Sample]], plan: Plan) -> dict[Case, Outcome]:
    """Measure the cases in turn, A B A B, until the plan is fulfilled. One that fails is left out from then on."""
    outcomes = {case: Outcome() for case in cases}
    for _ in range(WARM_UPS):
        _measure_round(cases, outcomes)
    end = time.perf_counter() + plan.budget
    for _ in range(plan.repeats):
        _measure_round(cases, outcomes)
        if time.perf_counter() >= end:
            break
    return outcomes


def _measure_round(cases: Mapping[Case, Callable[[], Sample]], outcomes: Mapping[Case, Outcome]) -> None:
    for case, measure in cases.items():
        outcome = outcomes[case]
        if not outcome.problem:
            try:
                outcome.samples.append(measure())
            except CaseError as error:
                outcome.problem = str(error)
