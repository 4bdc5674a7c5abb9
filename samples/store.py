"""Where the samples keep what takes long to compute: an ignored folder, one file for each set of parameters."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

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
    """
    key = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()[:16]
    path = FOLDER / f"{name}_{key}{suffix}"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_name(f"{name}_{key}_{os.getpid()}{suffix}")
        try:
            make(unfinished)
            os.replace(unfinished, path)
        finally:
            unfinished.unlink(missing_ok=True)
    return path
