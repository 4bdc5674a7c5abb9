"""Samples from the shell: ``python -m meniscus.samples.<name> --output file.blend``."""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def save_sample(build: Callable[..., Any], arguments: list[str] | None = None) -> int:
    """Build a sample and save it as a .blend file; every keyword option of `build` is an option of the command.

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
    # Imported here so that --help and the arrays of a sample do not need Blender.
    import bpy

    from .scene_parts import new_scene

    options = vars(_parser(build).parse_args(arguments))
    output = Path(options.pop("output")).resolve()
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        build(new_scene(), **options)
        bpy.ops.wm.save_as_mainfile(filepath=str(output), compress=True)
    except (OSError, RuntimeError) as error:
        print(f"The sample cannot be saved as '{output}': {error}", file=sys.stderr)
        return 1
    print(f"Saved {output}")
    return 0


def _parser(build: Callable[..., Any]) -> argparse.ArgumentParser:
    description = inspect.getdoc(inspect.getmodule(build)) or ""
    parser = argparse.ArgumentParser(
        description=description.split("\n\n")[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--output", required=True, help="the .blend file to write")
    for parameter in list(inspect.signature(build).parameters.values())[1:]:
        parser.add_argument(
            f"--{parameter.name.replace('_', '-')}", type=type(parameter.default), default=parameter.default, help=" "
        )
    return parser
