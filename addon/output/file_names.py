"""File names with tokens and a frame number in them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ..fluid.errors import InputError

PASS_TOKEN = "pass"
"""Stands for the name of a pass, where each has a file of its own."""

_LAST_HASHES = re.compile(r"#+(?=[^#]*$)")
_TOKEN = re.compile(r"\{\{|\}\}|\{([^{}]*)\}")


def expanded(pattern: str, values: Mapping[str, str]) -> str:
    """`pattern` with the value of each token ``{name}``; ``{{`` and ``}}`` stand for braces. ``{pass}`` stays.

    Tokens have the names that they have in Blender's own paths since 5.0, and work in any version.

    Raises
    ------
    InputError
        A token is unknown.
    """

    def value(match: re.Match[str]) -> str:
        name = match[1]
        if name is None or name == PASS_TOKEN:
            return match[0] if name else match[0][0]
        if name not in values:
            known = ", ".join(f"{{{token}}}" for token in (*values, PASS_TOKEN))
            raise InputError(f"Unknown token {match[0]} in the file name '{pattern}': choose from {known}")
        return re.sub(r'[<>:"/\\|?*]', "_", values[name])

    return _TOKEN.sub(value, pattern)


def pass_pattern(pattern: str, name: str | None) -> str:
    """`pattern` for the file of one pass: ``{pass}`` or an ending gives its name. Without a name the token goes."""
    token = f"{{{PASS_TOKEN}}}"
    if name is None:
        return re.sub(rf"[._-]?{re.escape(token)}", "", pattern)
    return pattern.replace(token, name) if token in pattern else ended(pattern, name)


def ended(pattern: str, ending: str) -> str:
    """`pattern` with an ending before the frame number, else before the extension."""
    path = Path(pattern)
    stem, hashes = re.fullmatch(r"(.*?)([._-]?#*)", path.stem, re.DOTALL).groups()  # type: ignore[union-attr]
    return str(path.with_name(f"{stem}_{ending}{hashes}{path.suffix}"))


def numbered_pattern(pattern: str) -> str:
    """`pattern` with ``####`` before its extension if its file name has no ``#``, as Blender does for animations."""
    path = Path(pattern)
    return pattern if "#" in path.name else str(path.with_name(f"{path.stem}####{path.suffix}"))


def frame_path(pattern: str, frame: int) -> Path:
    """`pattern` with the last run of ``#`` in its file name replaced by the frame number, padded with zeros."""
    path = Path(pattern)
    sign = "-" if frame < 0 else ""
    return path.with_name(_LAST_HASHES.sub(lambda hashes: sign + str(abs(frame)).zfill(len(hashes[0])), path.name))
