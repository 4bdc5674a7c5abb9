"""Samples from the shell: ``python -m meniscus.samples.<name> --output file.blend``."""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ..addon.fluid.errors import MeniscusError
from ..addon.output.whole_file import whole_file


def save_sample(build: Callable[..., Any], arguments: list[str] | None = None) -> int:
    """Build a sample and save it as a .blend file; every keyword of `build` is an option of the command.

    Parameters
    ----------
    build
        ``build(scene, *, option=default, ...)``; the first paragraph of its module's docstring is the help text.
    arguments
        Those of the command line; None for the process's own.

    Returns
    -------
    Exit status: 0 if the file was saved.
    """
    options = vars(_parser(build).parse_args(arguments))
    output = Path(options.pop("output")).absolute()
    # Imported here so that --help does not start Blender.
    from .scene_parts import new_scene, save_blend

    try:
        with whole_file(output) as unfinished:
            build(new_scene(), **options)
            save_blend(unfinished)
    except MeniscusError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"Saved {output}")
    return 0


def _parser(build: Callable[..., Any]) -> argparse.ArgumentParser:
    description = inspect.getdoc(inspect.getmodule(build)) or ""
    parser = argparse.ArgumentParser(description=description.split("\n\n")[0])
    parser.add_argument("--output", required=True, metavar="FILE", help="the .blend file to write")
    for option in list(inspect.signature(build).parameters.values())[1:]:
        kind = type(option.default)
        parser.add_argument(
            f"--{option.name.replace('_', '-')}",
            type=partial(_positive, kind),
            default=option.default,
            metavar="NUMBER",
            help=f"{option.default} if left out",
        )
    return parser


def _positive(kind: type[int] | type[float], text: str) -> float:
    try:
        value = kind(text)
    except ValueError:
        value = kind(0)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is no {'whole ' if kind is int else ''}number greater than 0")
    return value
