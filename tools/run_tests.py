"""Runs all tests and closes with a summary: lint, unit, render, native, the extension zip, and tests/blender in every host.

    .venv/bin/python tools/run_tests.py           all of it
    .venv/bin/python tools/run_tests.py --fast    the quick unit and render tests, the native tests on the fastest SIMD path

Wheels, toolchains and hosts are made ready in the background while the first suites run. What cannot be made ready is
skipped, loudly; where the environment variable CI is set, that is a failure.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import ParamSpec

import build_extension
import extension_wheels
import hosts
import lint
import native_tests
import rust
from project import ROOT, ToolError, command_line
from system_packages import ensure_test_programs

REPORTS = ROOT / "out" / "reports"
Parameters = ParamSpec("Parameters")
SUITES_AT_ONCE = 2
"""Of pytest, without a window, that run beside one another; each takes little more than one processor."""


@dataclass
class Result:
    """How one suite went and how long it took; a problem is a sentence, empty when all is well."""

    name: str
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    problem: str = ""
    is_missing: bool = False
    seconds: float = 0.0


def run_all() -> list[Result]:
    ensure_test_programs()
    with ThreadPoolExecutor(1) as compiling, ThreadPoolExecutor(1) as downloading, ThreadPoolExecutor(SUITES_AT_ONCE) as beside:
        compiling.submit(native_tests.compile_tests)
        nightly = compiling.submit(rust.nightly)
        wheels = compiling.submit(extension_wheels.collect)
        ready = {name: downloading.submit(hosts.prepare, name) for name in hosts.names()}
        results = [check("lint", lint.lint), *beside.map(pytest_suite, ("unit", "render"))]
        results += [native_suite(name) for name in native_tests.stable_suites()]
        results += [native_suite(name, nightly) for name in native_tests.NIGHTLY_SUITES]
        results.append(check("extension", lambda: build_after(wheels)))
        results += beside.map(host_suite, ready.keys(), ready.values())
        windows = {name: ready[window.host] for name, window in hosts.windows().items()}
        results += [window_suite(name, setup) for name, setup in windows.items()]
    return results


def run_fast() -> list[Result]:
    with ThreadPoolExecutor(1) as compiling:
        compiling.submit(native_tests.compile_tests)
        quick = ("-m", "not slow")
        results = [pytest_suite("unit", *quick), pytest_suite("render", *quick)]
    return [*results, native_suite(native_tests.stable_suites()[0])]


def timed(suite: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Have the result say how long the suite took."""

    @wraps(suite)
    def run(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        start = time.monotonic()
        result = suite(*args, **kwargs)
        result.seconds = time.monotonic() - start
        return result

    return run


def build_after(wheels: Future[list[Path]]) -> None:
    wheels.result()
    build_extension.build()


@timed
def check(name: str, action: Callable[[], object]) -> Result:
    """Run a check that has no tests to count."""
    announce(name)
    try:
        action()
    except ToolError as error:
        print(error, flush=True)
        return Result(name, failed=1, problem=str(error).splitlines()[0])
    return Result(name, passed=1)


def pytest_suite(name: str, *options: str) -> Result:
    """Run tests/NAME in the development environment."""
    command = [sys.executable, "-m", "pytest", "-q", "--junitxml", str(report_of(name)), f"tests/{name}", *options]
    return run_suite(name, name, command)


def host_suite(name: str, setup: Future[None]) -> Result:
    """Run the suite of a host, once that is set up."""
    try:
        setup.result()
    except ToolError as error:
        return missing_suite(name, error)
    command = [sys.executable, str(ROOT / "tools" / "hosts.py"), "--report", str(report_of(name)), name, "-q"]
    return run_suite(name, f"Blender tests: {name}", command)


@timed
def run_suite(name: str, title: str, command: list[str]) -> Result:
    """Run a suite that writes a report; what it says is shown in one piece, because another may run beside it."""
    done = subprocess.run(
        command,
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    announce(title, done.stdout)
    return result_of(name, done.returncode)


@timed
def window_suite(name: str, setup: Future[None]) -> Result:
    """Run the suite of a window, once its host is set up; alone, for it watches how what is drawn follows in time."""
    announce(f"Blender tests: {name}")
    try:
        setup.result()
    except ToolError as error:
        return missing_suite(name, error)
    try:
        status = hosts.run_window_suite(name, ["-q"], report_of(name))
    except ToolError as error:
        print(error, flush=True)
        return Result(name, failed=1, problem=str(error).splitlines()[0])
    return result_of(name, status)


@timed
def native_suite(name: str, toolchain: Future[dict[str, str]] | None = None) -> Result:
    """Run tests of native/, once the toolchain is there."""
    announce(name)
    try:
        if toolchain:
            toolchain.result()
    except ToolError as error:
        return missing_suite(name, error)
    outcome = native_tests.run_suite(name)
    result = Result(name, outcome.passed, outcome.failed, outcome.skipped)
    return judged(result, outcome.status if outcome.passed + outcome.failed else outcome.status or hosts.NO_TESTS_COLLECTED)


def missing_suite(name: str, error: ToolError) -> Result:
    print(error, flush=True)
    return Result(name, problem=str(error).splitlines()[0], is_missing=True)


def report_of(name: str) -> Path:
    """Where pytest's XML report of a suite goes; a report of an earlier run is removed."""
    REPORTS.mkdir(parents=True, exist_ok=True)
    report = REPORTS / f"{name}.xml"
    report.unlink(missing_ok=True)
    return report


def result_of(name: str, status: int) -> Result:
    """Read the counts from pytest's report."""
    result = Result(name)
    report = REPORTS / f"{name}.xml"
    if report.is_file():
        for suite in ElementTree.parse(report).iter("testsuite"):
            result.skipped += int(suite.get("skipped", 0))
            result.failed += int(suite.get("failures", 0)) + int(suite.get("errors", 0))
            result.passed += int(suite.get("tests", 0))
        result.passed -= result.failed + result.skipped
    return judged(result, status)


def judged(result: Result, status: int) -> Result:
    """The result of a suite that ended with this exit status, which has the last word."""
    if status == hosts.NO_TESTS_COLLECTED:
        result.problem = "no test was found"
    elif status and not result.failed:
        result.problem = f"ended with exit status {status}"
    if result.problem:
        result.failed += 1
    return result


def announce(title: str, text: str = "") -> None:
    print(f"\n=== {title} ===\n{text}", end="", flush=True)


def summarise(results: list[Result]) -> int:
    """Print the table, the hosts that are missing in a box, and one closing line; the exit status."""
    announce("summary")
    for result in results:
        counts = f"{result.passed:>5} passed {result.failed:>4} failed {result.skipped:>4} skipped {result.seconds:>5.0f} s"
        print(f"{result.name:<18} {counts}  {result.problem}")
    missing = [result for result in results if result.is_missing]
    if missing:
        print_box([f"NOT TESTED in {result.name}: {result.problem}" for result in missing])
    is_strict = bool(os.environ.get("CI"))
    failed = sum(result.failed for result in results) + (len(missing) if is_strict else 0)
    skipped = sum(result.skipped for result in results)
    print(f"tests: {sum(result.passed for result in results)} passed, {failed} failed, {skipped} skipped", flush=True)
    return 1 if failed else 0


def print_box(lines: list[str]) -> None:
    width = max(len(line) for line in lines)
    border = "#" * (width + 4)
    print("\n".join(["", border, *(f"# {line:<{width}} #" for line in lines), border, ""]))


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--fast"]):
        raise ToolError("run_tests.py takes no arguments but --fast")
    return summarise(run_fast() if arguments else run_all())


if __name__ == "__main__":
    command_line(main)
