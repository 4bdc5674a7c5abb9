"""The rows of Walking Depth Plane in the tables of Mueller, Grottel and Ertl 2007, and how well it holds a frame rate.

    PYTHONPATH=tests .venv/bin/python -m bench.walking_depth_plane [--scenes argon random_100k] [--size 640x480]

Prints two tables: milliseconds and what has not arrived by the number of passes (the paper's table 3, whose iterations have one
sample each where ours have four), and what frames take where a frame rate is asked for.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import meniscus

from .report import milliseconds, table
from .scenes import SCENES

METHOD = "walking_depth_plane"
PASSES = (5, 10, 25, 100, None)
"""None for as many as are needed."""
RATES = (60, 30, 15, 5, 2, 1)
"""Images a second to be held."""
LEARNING = 2
"""Frames that are left out: in them the method learns what its passes take."""
FRAMES = 7


@dataclass(frozen=True)
class Held:
    """What came of frames that had the same limits.

    Attributes
    ----------
    median, greatest
        Of the time of a frame, milliseconds: the whole call, passes of the image included.
    passes
        Of the last frame.
    unfinished
        The share of the rays that meet a ball which had not arrived, of the last frame.
    """

    median: float
    greatest: float
    passes: int
    unfinished: float

    @property
    def share(self) -> str:
        """What has not arrived, for tables."""
        return f"{100 * self.unfinished:.2f} %"


def measure(name: str, size: tuple[int, int], settings: dict[str, bool | int | float]) -> Held:
    """Render a scene several times, with the camera turned a little each time, as in a viewport."""
    scene = SCENES[name]
    balls = scene.make_balls()
    camera = scene.camera(balls, *size)
    times = []
    for number in range(LEARNING + FRAMES):
        seen = camera.shifted(0.1 * (number % 3), 0.1 * (number % 2))
        start = time.perf_counter()
        image = meniscus.render(balls, seen, scene.field, method=METHOD, settings=settings)
        times.append((time.perf_counter() - start) * 1e3)
    counts = image.info.counts
    counted = times[LEARNING:]
    return Held(statistics.median(counted), max(counted), counts["passes"], counts["unfinished"] / max(counts["rays"], 1))


def rows_by_passes(names: Sequence[str], size: tuple[int, int]) -> Iterator[list[str]]:
    """Scene, limit of passes, passes that were needed, time, what has not arrived."""
    for name in names:
        for limit in PASSES:
            held = measure(name, size, {} if limit is None else {"most_passes": limit})
            yield [name, "none" if limit is None else str(limit), str(held.passes), milliseconds(held.median), held.share]


def rows_by_rate(names: Sequence[str], size: tuple[int, int]) -> Iterator[list[str]]:
    """Scene, rate that is asked for, the budget, median and longest frame, rate that is held, passes, what has not arrived."""
    for name in names:
        for rate in RATES:
            held = measure(name, size, {"use_budget": True, "budget": 1e3 / rate})
            yield [
                *(name, str(rate), milliseconds(1e3 / rate), milliseconds(held.median), milliseconds(held.greatest)),
                *(f"{1e3 / held.median:.3g}", str(held.passes), held.share),
            ]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=["argon", "random_100k"])
    parser.add_argument("--size", default="640x480", help="width and height, pixels")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    headers = ["scene", "passes, at most", "passes", "ms", "not arrived"]
    print(table(headers, rows_by_passes(options.scenes, (width, height))), "\n", flush=True)
    headers = ["scene", "asked, 1/s", "budget, ms", "median, ms", "longest, ms", "held, 1/s", "passes", "not arrived"]
    print(table(headers, rows_by_rate(options.scenes, (width, height))))


if __name__ == "__main__":
    main()
