"""Tests of native/: on each SIMD path, under the address sanitizer, under Miri, and fuzzing.

.venv/bin/python tools/native_tests.py             all suites
.venv/bin/python tools/native_tests.py SUITE ...   some of them; --list names them
.venv/bin/python tools/native_tests.py --fuzz S    fuzz each target for S seconds, and keep what is found in out/fuzz

Miri interprets the tests of every module of the core that says `unsafe`, on the portable path, for it does not know AVX;
the address sanitizer watches the core's tests on the others. A test that is too slow for Miri says
`#[cfg_attr(miri, ignore)]`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import meniscus_native
import rust
from project import ROOT, ToolError, command_line, output_of, run

# These need a nightly.
NIGHTLY_SUITES = ("native-asan", "native-miri", "native-fuzz")

CORE = rust.NATIVE / "core" / "src"
FUZZ = rust.NATIVE / "fuzz"
FOUND = ROOT / "out" / "fuzz"
# In the test run what is tried at random is the same every time: so many inputs of each fuzz target after its corpus, and
# the scenes of the property tests. New ones are what `make fuzz` is for.
FUZZ_RUNS = 2000
SEED = "1"

# Calls of the binding that hypothesis makes in a second.
BINDING_CASES = 100

# As cargo-fuzz has it: the coverage that guides libFuzzer.
COVERAGE = (
    "-Cpasses=sancov-module",
    "-Cllvm-args=-sanitizer-coverage-level=4",
    "-Cllvm-args=-sanitizer-coverage-inline-8bit-counters",
    "-Cllvm-args=-sanitizer-coverage-pc-table",
    "-Cllvm-args=-sanitizer-coverage-trace-compares",
)
SANITIZER = "-Zsanitizer=address"
# Too big an allocation is an error here, not a defect.
SANITIZER_OPTIONS = "allocator_may_return_null=1"


@dataclass(frozen=True)
class Outcome:
    """What a run of tests came to."""

    status: int
    passed: int = 0
    failed: int = 0
    skipped: int = 0


def suites() -> list[str]:
    """The suites of this machine."""
    return [*stable_suites(), *NIGHTLY_SUITES]


def stable_suites() -> list[str]:
    return [f"native-{path}" for path in simd_paths()]


def simd_paths() -> list[str]:
    """The SIMD paths that this processor has, the fastest first."""
    paths: list[str] = meniscus_native.simd_paths()
    return paths


def run_suite(name: str) -> Outcome:
    if name == "native-asan":
        return test_sanitized()
    if name == "native-miri":
        return test_interpreted()
    if name == "native-fuzz":
        return fuzz([f"-runs={FUZZ_RUNS}", f"-seed={SEED}"])
    return run_cargo(["test", "--locked", "--no-fail-fast"], with_path(rust.stable(), name.removeprefix("native-")))


def compile_tests() -> None:
    """Compile what `run_suite` will run on the SIMD paths; what goes wrong is seen then."""
    command = ["cargo", "test", "--locked", "--no-run"]
    subprocess.run(command, env=rust.stable(), cwd=rust.NATIVE, stdin=subprocess.DEVNULL, capture_output=True, check=False)


def test_sanitized() -> Outcome:
    """The core's tests under the address sanitizer, on every path but the portable one."""
    variables = {**rust.nightly(), "RUSTFLAGS": SANITIZER, "ASAN_OPTIONS": SANITIZER_OPTIONS}
    # Only what is compiled for a named target is sanitized, not what compiles it.
    command = ["test", "--package", "meniscus-core", "--lib", "--no-fail-fast", "--target", host_triple(variables)]
    return total([run_cargo(command, with_path(variables, path)) for path in simd_paths() if path != "portable"])


def test_interpreted() -> Outcome:
    """The tests of the core's modules with `unsafe` under Miri; proptest may look at the disk and tries a few cases."""
    settings = {"MIRIFLAGS": "-Zmiri-disable-isolation", "PROPTEST_CASES": "8"}
    variables = with_path({**rust.nightly(), **settings}, "portable")
    return run_cargo(["miri", "test", "--package", "meniscus-core", "--lib", "--", *unsafe_modules()], variables)


def unsafe_modules() -> list[str]:
    """The top modules of the core, as filters of test names, that contain `unsafe` blocks."""
    files = [path for path in CORE.rglob("*.rs") if re.search(r"^[^/]*\bunsafe\b", path.read_text(), re.MULTILINE)]
    return sorted({f"{path.relative_to(CORE).parts[0].removesuffix('.rs')}::" for path in files})


def fuzz(limits: Sequence[str]) -> Outcome:
    """Replay each fuzz target's corpus and fuzz it within libFuzzer's `limits`; a target counts as a test."""
    variables = rust.nightly()
    target = host_triple(variables)
    flags = " ".join([SANITIZER, *COVERAGE, "--cfg=fuzzing"])
    build = ["cargo", "build", "--locked", "--package", "meniscus-fuzz", "--bins", "--target", target]
    run(build, env={**variables, "RUSTFLAGS": flags}, cwd=rust.NATIVE)
    programs = rust.NATIVE / "target" / target / "debug"
    statuses = [fuzz_target(programs / name, limits) for name in fuzz_targets()]
    failed = sum(status != 0 for status in statuses)
    return Outcome(int(failed > 0), len(statuses) - failed, failed)


def fuzz_targets() -> list[str]:
    return sorted(path.stem for path in (FUZZ / "fuzz_targets").glob("*.rs"))


def fuzz_target(program: Path, limits: Sequence[str]) -> int:
    """Run a fuzz target; what it finds lands in out/fuzz, inputs that fail as well as those that reach new code."""
    found, corpus = FOUND / program.name, FUZZ / "corpus" / program.name
    found.mkdir(parents=True, exist_ok=True)
    print(f"Fuzzing {program.name}", flush=True)
    options = [*limits, f"-artifact_prefix={found}/failed-", "-rss_limit_mb=4096", "-timeout=10"]
    variables = {**os.environ, "ASAN_OPTIONS": SANITIZER_OPTIONS}
    done = subprocess.run(
        [str(program), str(found), str(corpus), *options],
        env=variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode:
        print(done.stdout, flush=True)
    return done.returncode


def fuzz_binding(seconds: int) -> int:
    """Give the Python module anything, for about so long a call."""
    variables = {**os.environ, "MENISCUS_FUZZ_CASES": str(seconds * BINDING_CASES)}
    command = [sys.executable, "-m", "pytest", "-q", "-W", "ignore", "tests/unit/test_native_fuzz.py"]
    return subprocess.run(command, env=variables, cwd=ROOT, stdin=subprocess.DEVNULL, check=False).returncode


def run_cargo(arguments: Sequence[str], variables: Mapping[str, str]) -> Outcome:
    """Run cargo in native/, its output shown as it comes, and count the tests."""
    command = ["cargo", *arguments]
    lines = []
    with subprocess.Popen(
        command, env=dict(variables), cwd=rust.NATIVE, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    return count(lines, process.returncode)


def count(lines: Sequence[str], status: int) -> Outcome:
    """Add up what the test programs say at their ends."""
    results = [re.match(r"test result: \w+\. (\d+) passed; (\d+) failed; (\d+) ignored", line) for line in lines]
    counts = [tuple(map(int, result.groups())) for result in results if result]
    return Outcome(status, *(sum(column) for column in zip(*counts)))


def total(outcomes: Sequence[Outcome]) -> Outcome:
    status = max((outcome.status for outcome in outcomes), key=abs, default=0)
    sums = (sum(getattr(outcome, field) for outcome in outcomes) for field in ("passed", "failed", "skipped"))
    return Outcome(status, *sums)


def with_path(variables: Mapping[str, str], path: str) -> dict[str, str]:
    return {**variables, "MENISCUS_SIMD": path, "PROPTEST_RNG_SEED": SEED}


def host_triple(variables: Mapping[str, str]) -> str:
    return output_of(["rustc", "--print", "host-tuple"], env=variables).strip()


def main(arguments: list[str]) -> int:
    if arguments == ["--list"]:
        print("\n".join(suites()))
        return 0
    if arguments[:1] == ["--fuzz"] and len(arguments) == 2 and arguments[1].isdigit():
        seconds = int(arguments[1])
        return fuzz([f"-max_total_time={seconds}"]).status or fuzz_binding(seconds)
    unknown = set(arguments) - set(suites())
    if unknown:
        raise ToolError(f"'{min(unknown)}' is no suite; there are {', '.join(suites())}")
    return total([run_suite(name) for name in arguments or suites()]).status


if __name__ == "__main__":
    command_line(main)
