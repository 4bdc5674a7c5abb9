"""Where the samples keep what takes long to compute: an ignored folder, one file for each set of parameters."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..addon.output.whole_file import whole_file

FOLDER = Path(__file__).resolve().parents[1] / ".cache" / "samples"


def stored_file(name: str, suffix: str, parameters: Mapping[str, Any], make: Callable[[Path], None]) -> Path:
    """The file that `make` writes for these parameters, made only where it is not there yet.

    Parameters
    ----------
    name, suffix
        Of the file, ``dam_break`` and ``.blend``.
    parameters
        All that the content depends on, plain data; becomes part of the file's name.
    make
        Writes the file to the path that it is given; the file takes its place only when it is whole.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    key = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()[:16]
    path = FOLDER / f"{name}_{key}{suffix}"
    if not path.exists():
        with whole_file(path) as unfinished:
            make(unfinished)
    return path


def source_texts(*modules: Any) -> list[str]:
    """The text of modules, as parameters: what they compute is computed anew when they change."""
    return [Path(module.__file__).read_text(encoding="utf-8") for module in modules]
