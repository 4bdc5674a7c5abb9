"""Points in PLY files (Turk 1994): what most programs read, Blender among them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..fluid.errors import OutputError
from .whole_file import whole_file

Columns = Mapping[str, npt.NDArray[Any]]

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
_NAMES = {np.dtype("<f4"): "float", np.dtype("<i4"): "int"}
_LONGEST_HEADER = 1 << 16


def write_points(path: str | os.PathLike[str], columns: Columns) -> None:
    """Write points as a binary PLY file, which replaces `path` only when it is whole.

    Parameters
    ----------
    path
        The file; missing folders are made.
    columns
        By the name of the property: (N,) float32 or int32 each.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    row = np.dtype([(name, column.dtype.newbyteorder("<")) for name, column in columns.items()])
    points = np.empty(len(next(iter(columns.values()))), row)
    for name, column in columns.items():
        points[name] = column
    properties = [f"property {_NAMES[row[name]]} {name}" for name in columns]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *properties, "end_header", ""]
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write("\n".join(lines).encode())
        file.write(points.tobytes())


def read_points(path: str | os.PathLike[str], names: tuple[str, ...]) -> dict[str, npt.NDArray[Any]]:
    """Properties of the points in a binary little-endian PLY file, (N,) each; whatever else it holds is passed over.

    Raises
    ------
    OutputError
        The file cannot be read, is not whole, or lacks one of the properties that are named.
    """
    place = Path(path)
    try:
        with place.open("rb") as file:
            count, row = _layout(file)
            content = file.read(count * row.itemsize)
    except OSError as error:
        raise OutputError(f"Cannot read {place}: {(error.strerror or str(error)).lower()}; bake it again") from error
    except (ValueError, KeyError) as error:
        raise OutputError(f"Cannot read {place}: it is not a binary PLY file of points; bake it again") from error
    missing = [name for name in names if name not in (row.names or ())]
    if missing or len(content) < count * row.itemsize:
        problem = f"it has no property '{missing[0]}'" if missing else "it is not whole"
        raise OutputError(f"Cannot read {place}: {problem}; bake it again")
    points = np.frombuffer(content, row, count)
    return {name: np.ascontiguousarray(points[name]) for name in names}


def _layout(file: BinaryIO) -> tuple[int, np.dtype[Any]]:
    """How many points there are, and how one lies in the file, which is read up to the first; ValueError, KeyError."""
    lines = list(_header_lines(file))
    if lines[:1] != [["ply"]] or lines[1:2] != [["format", "binary_little_endian", "1.0"]]:
        raise ValueError("another format")
    count, fields = -1, list[tuple[str, str]]()
    for words in lines[2:]:
        match words:
            case ["element", "vertex", number] if count < 0:
                count = int(number)
            case ["element", *_] if count < 0:
                raise ValueError("points are not first")
            case ["element", *_]:
                break
            case ["property", kind, name]:
                fields.append((name, "<" + _TYPES[kind]))
            case ["property", *_]:
                raise ValueError("points with lists")
    if count < 0:
        raise ValueError("no points")
    return count, np.dtype(fields)


def _header_lines(file: BinaryIO) -> Iterator[list[str]]:
    """The words of each line up to the end of the header; ValueError where there is none."""
    while file.tell() < _LONGEST_HEADER:
        line = file.readline(_LONGEST_HEADER)
        if line.strip() == b"end_header":
            return
        if not line:
            break
        yield line.decode("ascii").split()
    raise ValueError("header")
