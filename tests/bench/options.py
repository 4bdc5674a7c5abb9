"""The command line options that both benchmarks have."""

from __future__ import annotations

import argparse

from .scenes import SCENES, SIZES
from .timing import Plan


def parser(name: str, description: str, scenes: tuple[str, ...], plan: Plan, limit: float) -> argparse.ArgumentParser:
    """A parser with these defaults."""
    options = argparse.ArgumentParser(
        prog=f"make {name}", description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    options.add_argument("--scenes", nargs="+", choices=SCENES, default=scenes, metavar="NAME", help=", ".join(SCENES))
    options.add_argument("--sizes", nargs="+", type=size, default=SIZES, metavar="WxH", help="of the pictures, pixels")
    options.add_argument("--repeats", type=int, default=plan.repeats, help="measured rounds of a case")
    options.add_argument("--budget", type=float, default=plan.budget, help="seconds after which no round of a case begins")
    options.add_argument("--limit", type=float, default=limit, help="seconds that one run may take")
    options.add_argument("--update-docs", action="store_true", help="also put the tables into docs/benchmarks.md")
    return options


def size(text: str) -> tuple[int, int]:
    """640x480 as a pair."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"'{text}' is no size such as 640x480")
    return int(width), int(height)
