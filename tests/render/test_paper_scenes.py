"""The experiments of Kanamori, Szego and Nishita 2008: every method against the oracle."""

from __future__ import annotations

import math

import pytest
from judge import bounds_of
from paper_scenes import NAMES, PIXELS, compare_picture

from meniscus.addon.render.registry import method_infos

METHODS = [info.name for info in method_infos("metaballs")]
RELATIVE_RMS = 1e-5
"""Of t; the paper, section 6, reports 7e-3."""
SMALL = ("kanamori_figure_1", "kanamori_figure_2", "kanamori_figure_11")


def cases():
    """Methods that sample take too long for the large scenes."""
    for method in METHODS:
        for name in SMALL if bounds_of(method).wrong else NAMES:
            yield pytest.param(method, name, marks=[] if name in SMALL else [pytest.mark.slow])


@pytest.mark.parametrize(("method", "name"), list(cases()))
def test_the_papers_pictures_match_the_oracle(method, name):
    verdict, bounds = compare_picture(method, name), bounds_of(method)
    assert verdict.compared > 0.1 * PIXELS, "the picture should show something"
    assert len(verdict.wrong) <= math.ceil(bounds.wrong * PIXELS), (
        f"{len(verdict.wrong)} wrong pixels of {PIXELS}: {verdict.wrong[:5]}"
    )
    assert verdict.undecidable <= 0.002 * PIXELS
    # Where something may be missed, what is seen still lies nearer than in the paper.
    assert verdict.relative_rms <= (bounds.rms if bounds.wrong else RELATIVE_RMS)
    assert verdict.tilted <= bounds.tilted * PIXELS, f"{verdict.tilted} normals are off, by up to {verdict.worst_angle} degrees"
