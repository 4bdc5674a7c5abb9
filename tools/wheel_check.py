"""Whether the compiled module in a native wheel would load on its platform, seen from any other."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import lief
from project import ToolError

INITIALISER = "PyInit_meniscus_native"

# What it prints about files that it reads well.
lief.logging.disable()


@dataclass(frozen=True)
class Library:
    """The names of the functions that a library exports, and of the libraries that it needs."""

    exports: frozenset[str]
    needs: tuple[str, ...]


def check(wheel: Path, allowed: Iterable[str]) -> None:
    """Fail where the wheel does not hold one Python module, or that needs a library other than the allowed patterns."""
    with zipfile.ZipFile(wheel) as archive:
        members = [archive.read(name) for name in archive.namelist() if name.endswith((".so", ".pyd"))]
    library = read(members[0]) if len(members) == 1 else None
    if library is None or INITIALISER not in library.exports:
        raise ToolError(f"{wheel.name} should hold one library that exports {INITIALISER}; it was built wrongly.")
    unknown = [name for name in library.needs if not any(fnmatch(name.lower(), pattern.lower()) for pattern in allowed)]
    if unknown:
        raise ToolError(f"The library in {wheel.name} needs {', '.join(unknown)}, which not every such system has.")


def read(content: bytes) -> Library | None:
    """Read a library of Linux, macOS or Windows; None where it is none."""
    binary = lief.parse(content)
    if isinstance(binary, lief.MachO.Binary):
        # Among them is the library's own name. Names of C functions begin with an underscore there.
        loads = [load for load in binary.libraries if load.command != lief.MachO.LoadCommand.TYPE.ID_DYLIB]
        exports = frozenset(str(symbol.name).removeprefix("_") for symbol in binary.exported_symbols)
        return Library(exports, tuple(load.name for load in loads))
    if isinstance(binary, (lief.ELF.Binary, lief.PE.Binary)):
        exports = frozenset(str(function.name) for function in binary.exported_functions)
        return Library(exports, tuple(str(name) for name in binary.libraries))
    return None
