"""Splits a range of frames over several Blenders on this computer. Needs Python 3.10 or newer and nothing else.

python farm.py --workers 4 scene.blend --frames 1:240 -- --output //passes/fluid_####.exr --passes depth,normal

What follows ``--`` goes to ``--command meniscus render`` as it is. Workers take the next few frames when they are done with the
last ones, so that slow frames do not keep the others waiting. Frames that failed are tried once more at the end. The exit
status is 0 only if every frame is there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Outcome:
    """Frames that are written, and sentences about those that are not."""

    frames: set[int] = field(default_factory=set)
    problems: dict[int, str] = field(default_factory=dict)


def main(arguments: list[str] | None = None) -> int:
    """Render the range; the exit status."""
    options, for_meniscus = _options(sys.argv[1:] if arguments is None else arguments)
    wanted = list(range(options.first, options.last + 1, options.step))
    outcome = Outcome()
    for attempt in range(2):
        missing = [frame for frame in wanted if frame not in outcome.frames]
        if missing:
            # The second time each frame alone, so that one that ends Blender takes no other with it.
            _render(options, for_meniscus, _chunks(missing, options.chunk if attempt == 0 else 1), outcome)
    missing = [frame for frame in wanted if frame not in outcome.frames]
    print(f"{len(wanted) - len(missing)} of {len(wanted)} frames are there", flush=True)
    for frame in missing:
        print(f"Frame {frame}: {outcome.problems.get(frame, 'was not rendered')}", file=sys.stderr)
    return 1 if missing else 0


def _options(arguments: list[str]) -> tuple[argparse.Namespace, list[str]]:
    own, for_meniscus = arguments, []
    if "--" in arguments:
        own, for_meniscus = arguments[: arguments.index("--")], arguments[arguments.index("--") + 1 :]
    parser = argparse.ArgumentParser(description="Splits a range of frames over several Blenders.")
    parser.add_argument("blend", metavar="SCENE.blend")
    parser.add_argument("--frames", required=True, metavar="FIRST:LAST[:STEP]", help="write --frames=-5:5 for negative ones")
    parser.add_argument("--workers", type=int, default=2, help="Blenders at a time; 2 if left out")
    parser.add_argument("--chunk", type=int, default=8, help="frames that a Blender takes at a time; 8 if left out")
    parser.add_argument("--blender", default="blender", metavar="PROGRAM", help="blender if left out")
    options = parser.parse_args(own)
    try:
        options.first, options.last, options.step = map(int, (options.frames.split(":") + ["1"])[:3])
    except ValueError:
        parser.error(f"'{options.frames}' is no range of frames; write FIRST:LAST or FIRST:LAST:STEP")
    if options.workers < 1 or options.chunk < 1 or options.step < 1:
        parser.error("workers, frames at a time and the step must be at least 1")
    return options, for_meniscus


def _chunks(frames: list[int], size: int) -> list[list[int]]:
    return [frames[start : start + size] for start in range(0, len(frames), size)]


def _render(options: argparse.Namespace, for_meniscus: list[str], chunks: list[list[int]], outcome: Outcome) -> None:
    """Have workers render chunks of frames, and note what becomes of them."""
    threads = max(1, (os.cpu_count() or 1) // options.workers)
    with ThreadPoolExecutor(options.workers) as workers:
        reports = workers.map(lambda chunk: _report(options, for_meniscus, chunk, threads), chunks)
        for chunk, report in zip(chunks, reports, strict=True):
            for frame in report["frames"]:
                if frame["error"]:
                    outcome.problems[frame["frame"]] = frame["error"]
                else:
                    outcome.frames.add(frame["frame"])
            for number in chunk:
                if number not in outcome.frames:
                    outcome.problems.setdefault(number, report["error"])
            print(f"Frames {chunk[0]} to {chunk[-1]}: {len(outcome.frames)} are there so far", flush=True)


def _report(options: argparse.Namespace, for_meniscus: list[str], chunk: list[int], threads: int) -> dict[str, Any]:
    """Render a few frames in a Blender of their own; its JSON report, or one that says why there is none."""
    frames = ",".join(map(str, chunk))
    command = [options.blender, "--background", "--threads", str(threads), options.blend]
    command += ["--command", "meniscus", "render", f"--frames={frames}", *for_meniscus, "--json", "-"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        return {"frames": [], "error": f"{options.blender} cannot be started: {error}"}
    for line in reversed(result.stdout.splitlines()):
        if line.startswith('{"frames_wanted"'):
            report: dict[str, Any] = json.loads(line)
            return report
    said = (result.stderr.strip() or result.stdout.strip()).splitlines()
    return {
        "frames": [],
        "error": f"Blender ended with the status {result.returncode}: {said[-1] if said else 'it said nothing'}",
    }


if __name__ == "__main__":
    raise SystemExit(main())
