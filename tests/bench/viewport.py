"""`make bench-viewport`: how the viewport feels in real windows, with 120,000 particles."""

from __future__ import annotations

import json
from argparse import ArgumentParser
from typing import Any

import hosts
import numpy as np

from . import machine, report

MEASURES = "measure_viewport.py"


def main(arguments: list[str] | None = None) -> None:
    parser = ArgumentParser(prog="bench-viewport", description="Time the viewport in real windows.")
    parser.add_argument("--windows", nargs="+", default=list(hosts.windows()), choices=list(hosts.windows()))
    parser.add_argument("--update-docs", action="store_true", help="write the report into docs/benchmarks.md")
    options = parser.parse_args(arguments)
    about = machine.describe()
    print(about["warning"], flush=True)
    measured = {name: measure(name) for name in options.windows}
    about["gl_renderer"] = "; ".join(f"{name}: {result['renderer']}" for name, result in measured.items())
    text = f"{report.machine_text(about)}\n\n{table_of(measured)}"
    report.publish("bench-viewport", {"machine": about, "windows": measured}, text, options.update_docs)


def measure(name: str) -> dict[str, Any]:
    """What MEASURES finds in a window."""
    host = hosts.windows()[name].host
    hosts.prepare(host)
    with hosts.stage_for(host) as stage:
        hosts.install_extension(stage)
        hosts.run_in_window(stage, name, MEASURES, ["-q", "-s"])
        return json.loads((stage.folder / "pictures" / "viewport.json").read_text())


def table_of(measured: dict[str, dict[str, Any]]) -> str:
    """A column a window; medians, and in brackets the quartiles."""
    rows = [
        ["Blender", *[result["blender"] for result in measured.values()]],
        ["viewport, pixels", *["{}x{}".format(*result["size"]) for result in measured.values()]],
        ["particles", *[str(result["balls"]) for result in measured.values()]],
        ["handler, nothing changed, ms", *[spread(result["still_ms"]) for result in measured.values()]],
        ["orbiting, images a second", *[f"{result['orbit_per_second']:.1f}" for result in measured.values()]],
        ["orbiting, handler, ms", *[spread(result["orbit_ms"]) for result in measured.values()]],
        ["orbiting, share of the pixels", *[spread(result["orbit_parts"]) for result in measured.values()]],
        ["full resolution after the last move, ms", *[spread(result["full_after_ms"]) for result in measured.values()]],
        ["first image after enabling, ms", *[report.milliseconds(result["first_image_ms"]) for result in measured.values()]],
        ["new frame to its first image, ms", *[spread(result["frame_ms"]) for result in measured.values()]],
    ]
    return report.table(["", *measured], rows)


def spread(values: list[float]) -> str:
    """Median and quartiles."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{report.milliseconds(middle)} [{report.milliseconds(low)}, {report.milliseconds(high)}]"


if __name__ == "__main__":
    main()
