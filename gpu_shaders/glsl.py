"""The shader preprocessor: nested include-once, constants, and line numbers that lead back to the files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..addon.fluid.errors import DeviceError

ROOT = Path(__file__).parent
# "0:12(3): error" (Mesa), "0(12) : error" (NVIDIA), "ERROR: 0:12: ..." (others): the source-string number comes first.
_LOG_ENTRY = re.compile(r"^((?:ERROR: |WARNING: )?)(\d+)(?=[:(]\d+[:()])", re.MULTILINE)
_INCLUDE = re.compile(r'^\s*#include "([^"]+)"\s*$')


class Source:
    """A shader's text as the driver gets it, and the files that it came from.

    Attributes
    ----------
    text
        GLSL with a ``#version`` line, the constants and all includes.
    files
        Paths by the source-string number of the ``#line`` directives.
    """

    def __init__(
        self, path: str, constants: Mapping[str, object] | None = None, version: int = 330, declarations: Sequence[str] = ()
    ) -> None:
        self.files: list[str] = []
        self._constants = [f"#define {name} {value}" for name, value in (constants or {}).items()]
        self._lines_of_files = self._lines(path)
        self.text = "\n".join([f"#version {version} core", *self._constants, *declarations, *self._lines_of_files]) + "\n"

    @property
    def body(self) -> str:
        """The text for compilers that declare what goes in and out themselves, and take no numbers of lines."""
        lines = (line for line in self._lines_of_files if not line.startswith("#line "))
        return "\n".join([*self._constants, *lines]) + "\n"

    def _lines(self, path: str) -> list[str]:
        """The lines of `path` (below gpu_shaders/), each include in place of its first mention."""
        if path in self.files:
            return []
        number = len(self.files)
        self.files.append(path)
        lines = [f"#line 1 {number}"]
        for index, line in enumerate(_read(path).splitlines(), start=1):
            include = _INCLUDE.match(line)
            if include:
                lines += [*self._lines(include.group(1)), f"#line {index + 1} {number}"]
            else:
                lines.append(line)
        return lines

    def explain(self, log: str) -> str:
        """The compiler's `log` with file names in place of source-string numbers."""
        return _LOG_ENTRY.sub(lambda match: match.group(1) + self._file(int(match.group(2))), log)

    def _file(self, number: int) -> str:
        return self.files[number] if number < len(self.files) else str(number)


def explain(log: str, sources: Mapping[str, Source]) -> str:
    """A log of several shaders, each line with the file names of its shader.

    Parameters
    ----------
    log
        What a compiler or linker writes.
    sources
        The shaders, each by the line that stands before its messages.
    """
    explained = []
    source = None
    for line in log.splitlines():
        source = sources.get(line.strip(), source)
        explained.append(source.explain(line) if source else line)
    return "\n".join(explained)


def _read(path: str) -> str:
    try:
        return (ROOT / path).read_text(encoding="utf-8")
    except OSError as error:
        raise DeviceError(f"The shader file '{path}' cannot be read ({error.strerror}); reinstall the extension") from error
