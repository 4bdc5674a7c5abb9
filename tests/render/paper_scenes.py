"""The experiments of Kanamori, Szego and Nishita 2008, each picture compared with the oracle at random pixels."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from bench.scenes import DAM_BREAK_FRAME, SCENES, dam_break_balls
from judge import Verdict, compare
from scenes import Scene

import meniscus

WIDTH, HEIGHT = 320, 240
PIXELS = 800

_small_tank = partial(dam_break_balls, 0.08, DAM_BREAK_FRAME, DAM_BREAK_FRAME)
_IN_PLACE = {"kanamori_figure_10_whole": _small_tank, "kanamori_figure_10_close": _small_tank}
"""Balls in place of a scene's own, which take many minutes to simulate."""
_LEFT_OUT = ("kanamori_table_1_50k", "kanamori_table_1_200k")
"""The same again with other numbers of balls."""

NAMES = tuple(name for name in SCENES if name.startswith("kanamori") and name not in _LEFT_OUT)


@cache
def _balls(name: str) -> meniscus.Balls:
    return _IN_PLACE.get(name, SCENES[name].make_balls)()


def compare_picture(method: str, name: str) -> Verdict:
    """Render a scene of NAMES with a method, and compare PIXELS of its pixels."""
    balls, field = _balls(name), SCENES[name].field
    camera = SCENES[name].camera(balls, WIDTH, HEIGHT)
    image = meniscus.render(balls, camera, field, method=method)
    pixels = np.random.default_rng(1).choice(WIDTH * HEIGHT, PIXELS, replace=False)
    return compare(image, Scene(balls, field=field), camera, pixels)
