"""File names with tokens and a frame number in them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from ..fluid.errors import InputError

PASS_TOKEN = "pass"
"""Stands for the name of a pass, where each has a file of its own."""

_LAST_HASHES = re.compile(r"#+(?=[^#]*$)")
_TOKEN = re.compile(r"\{\{|\}\}|\{([^{}:]*)(?::([^{}]*))?\}|[{}]")
_FORMAT = re.compile(r"(#*)(?:\.(#+))?")

Value = str | int | float | Path
"""Of a token: numbers can have a format, a path stands for a folder and ends with a slash, as in Blender."""


def expanded(pattern: str, values: Mapping[str, Value]) -> str:
    """`pattern` with the value of each token ``{name}``; ``{{`` and ``}}`` stand for braces. ``{pass}`` stays.

    Names and formats are those of Blender's own paths since 5.0, and work in any version: ``{fps:###}`` is a whole number with
    three digits at least, ``{fps:.##}`` has two decimals, ``{fps:###.##}`` both. What files cannot be called becomes ``_``, and
    so does ``#``, which would be taken for the frame number.

    Raises
    ------
    InputError
        A token or its format is unknown, or a brace has no partner.
    """

    def value(match: re.Match[str]) -> str:
        whole, name, number_format = match[0], match[1], match[2]
        if whole in ("{{", "}}"):
            return whole[0]
        if name is None:
            raise InputError(f"A '{whole}' without its partner in the file name '{pattern}': write '{whole * 2}' for a brace")
        if whole == f"{{{PASS_TOKEN}}}":
            return whole
        if name not in values:
            known = ", ".join(f"{{{token}}}" for token in (*values, PASS_TOKEN))
            raise InputError(f"Unknown token {whole} in the file name '{pattern}': choose from {known}")
        return _text(values[name]) if number_format is None else _number(values[name], number_format, whole)

    return _TOKEN.sub(value, pattern)


def _text(value: Value) -> str:
    if isinstance(value, Path):
        return f"{value}{os.sep}"
    if not isinstance(value, str):
        return str(value)
    safe = re.sub(r'[\x00-\x1f<>:"/\\|?*#]', "_", value)
    return "_" + safe[1:] if safe and not safe.strip(".") else safe


def _number(value: Value, number_format: str, token: str) -> str:
    match = _FORMAT.fullmatch(number_format)
    if not number_format or not match or isinstance(value, str | Path):
        raise InputError(f"Unknown format in the token {token}: numbers can have ###, .## or ###.##, names and folders none")
    decimals = len(match[2] or "")
    width = len(match[1]) + (decimals + 1 if decimals else 0)
    return f"{value:0{width}.{decimals}f}"


def pass_pattern(pattern: str, name: str | None) -> str:
    """`pattern` for the file of one pass: ``{pass}`` or an ending gives its name. Without a name the token goes."""
    token = f"{{{PASS_TOKEN}}}"
    if name is not None:
        return pattern.replace(token, name) if token in pattern else ended(pattern, name)
    rest = re.sub(rf"[._-]?{re.escape(token)}", "", pattern)
    return rest if Path(rest).suffix else pattern.replace(token, "passes")


def ended(pattern: str, ending: str) -> str:
    """`pattern` with an ending before the frame number, else before the extension."""
    path = Path(pattern)
    stem = path.stem.rstrip("#")
    stem = stem[:-1] if stem.endswith((".", "_", "-")) else stem
    hashes = path.stem[len(stem) :]
    name = f"{stem}_{ending}{hashes}" if stem else f"{ending}_{hashes}"
    return str(path.with_name(name + path.suffix))


def numbered_pattern(pattern: str) -> str:
    """`pattern` with ``####`` before its extension if its file name has no ``#``, as Blender does for animations."""
    path = Path(pattern)
    return pattern if "#" in path.name else str(path.with_name(f"{path.stem}####{path.suffix}"))


def frame_path(pattern: str, frame: int) -> Path:
    """`pattern` with the last run of ``#`` in its file name replaced by the frame number, padded with zeros."""
    path = Path(pattern)
    sign = "-" if frame < 0 else ""
    return path.with_name(_LAST_HASHES.sub(lambda hashes: sign + str(abs(frame)).zfill(len(hashes[0])), path.name))
