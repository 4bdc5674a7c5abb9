"""From rows to tables and files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from meniscus.addon.output.whole_file import whole_file

from .timing import Statistics

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out"
DOCUMENT = ROOT / "docs" / "benchmarks.md"


def milliseconds(value: float) -> str:
    """Three digits, without an exponent."""
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def median_and_spread(of: Statistics) -> str:
    """The median, and where there are several values the quartiles."""
    if of.count == 1:
        return milliseconds(of.median)
    return f"{milliseconds(of.median)} [{milliseconds(of.low_quartile)}, {milliseconds(of.high_quartile)}]"


def seconds(of: Statistics) -> str:
    """The median and the quartiles of milliseconds, in seconds."""
    if of.count == 1:
        return f"{of.median / 1e3:.3g}"
    return f"{of.median / 1e3:.3g} [{of.low_quartile / 1e3:.3g}, {of.high_quartile / 1e3:.3g}]"


def ratio(of: Statistics | None, to: Statistics | None) -> str:
    """Of two medians; empty where one was not measured."""
    if of is None or to is None:
        return ""
    value = of.median / to.median
    return f"{value:.2f}" if value < 10 else f"{value:.0f}"


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table whose columns line up, numbers to the right."""
    body = [[cell.replace("|", "/") for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(headers, *body, strict=True)]
    is_number = list(map(_is_numbers, zip(*body, strict=True))) or [False] * len(headers)

    def line(cells: Sequence[str]) -> str:
        columns = zip(cells, widths, is_number, strict=True)
        padded = [cell.rjust(width) if right else cell.ljust(width) for cell, width, right in columns]
        return f"| {' | '.join(padded)} |"

    rule = [f"{'-' * (width - 1)}:" if right else "-" * width for width, right in zip(widths, is_number, strict=True)]
    return "\n".join([line(headers), f"| {' | '.join(rule)} |", *map(line, body)])


def _is_numbers(column: Sequence[str]) -> bool:
    return any(column) and all(cell == "" or cell[0].isdigit() for cell in column)


def machine_text(machine: dict[str, Any]) -> str:
    """A paragraph that says what the run was made on."""
    lines = [
        f"{machine['time']}. {machine['processor']}, {machine['cores']} cores ({', '.join(machine['simd'])}), "
        f"{machine['memory_gib']} GiB; {machine['system']}; Meniscus {machine['meniscus']}, Python {machine['python']}, "
        f"numpy {machine['numpy']}. OpenGL: {machine['gl_renderer']}. Load before the run: {machine['load']}."
    ]
    if machine["warning"]:
        lines.append(f"**{machine['warning']}**")
    return "\n\n".join(lines)


def publish(name: str, data: dict[str, Any], text: str, into_document: bool, page: Path | None = None) -> None:
    """Print the report, write it to out/NAME.json and out/NAME.md, and into its place in the page if so asked.

    The page is DOCUMENT if left out.
    """
    page = page or DOCUMENT
    with whole_file(OUT / f"{name}.json") as path:
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    with whole_file(OUT / f"{name}.md") as path:
        path.write_text(text + "\n", encoding="utf-8")
    if into_document:
        document = with_section(page.read_text(encoding="utf-8"), name, text)
        with whole_file(page) as path:
            path.write_text(document, encoding="utf-8")
    print(f"\n{text}\n\nWritten: {OUT / name}.json and .md", flush=True)


def with_section(document: str, name: str, text: str) -> str:
    """The document with `text` between the marks of a generated section.

    Raises
    ------
    ValueError
        The document has no such section.
    """
    begin, end = f"<!-- begin {name} -->\n", f"\n<!-- end {name} -->"
    head, found_begin, rest = document.partition(begin)
    _, found_end, tail = rest.partition(end)
    if not (found_begin and found_end):
        raise ValueError(f"The document has no section between '{begin.strip()}' and '{end.strip()}'")
    return f"{head}{begin}{text}{end}{tail}"
