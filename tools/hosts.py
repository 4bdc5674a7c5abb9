"""Runs the tests in every Blender there is: the bpy wheels, Debian's real programs and the machine's own.

    python3 tools/hosts.py --list                                name the hosts and the windows
    python3 tools/hosts.py HOST | WINDOW [PYTEST_ARGUMENT ...]   set one up if need be, and test in it
    python3 tools/hosts.py --report FILE HOST [PYTEST_ARGUMENT ...]  without a window, and write pytest's XML report

All run tests/blender without a window; the real programs also run tests/gui, in their windows under Xvfb, and in them the built
zip is installed and enabled first and tested at the next start. The machine's own Blender is the host `blender-own`;
BLENDER=/path/to/blender says where it is. Pictures of what went wrong in a window go to out/windows.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import debian_blender
import environments
from complaints import complaints
from project import CACHE, REQUIREMENTS, ROOT, ToolError, command_line, fingerprint, locked, run

OWN = "blender-own"
SUITE = "tests/blender"
WINDOW_SUITE = "tests/gui"
# What the tests need beside the installed extension.
STAGED = ("tests", "samples", "tools/complaints.py", "pyproject.toml")
NO_TESTS_COLLECTED = 5
PYTEST_OPTIONS = ["-p", "no:cacheprovider"]
# The Pythons in the Blenders from 4.2 on.
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
PICTURES = ROOT / "out" / "windows"


@dataclass(frozen=True)
class Stage:
    """A folder that a Blender program can see: where it lies, what it is called there, and how the program is started.

    `window_command` starts it with a window that nobody needs to see.
    """

    folder: Path
    path_inside: str
    command: list[str]
    window_command: list[str]


@dataclass(frozen=True)
class Window:
    """A real program with a window: its host, and the arguments that Blender gets."""

    host: str
    arguments: tuple[str, ...] = ()


def names() -> list[str]:
    """Every host of this machine; its own Blender only where BLENDER names it."""
    own = [OWN] if os.environ.get("BLENDER") else []
    return [*bpy_names(), *debian_blender.PROGRAMS, *own]


def windows() -> dict[str, Window]:
    """Every window to test in, by name. Blender 4.3 can draw with Vulkan only experimentally."""
    with_default = {f"{name}-window": Window(name) for name in names() if name not in bpy_names()}
    return {**with_default, "blender-5.2-vulkan": Window("blender-5.2", ("--gpu-backend", "vulkan"))}


def bpy_names() -> list[str]:
    return [name for name in environments.ENVIRONMENTS if name.startswith("bpy-")]


def prepare(name: str) -> None:
    """Set the host up; quick when it is already."""
    if name in bpy_names():
        environments.ensure(name)
        return
    ensure_sites()
    if name in debian_blender.PROGRAMS:
        debian_blender.ensure(name)
    elif name != OWN:
        raise ToolError(f"'{name}' is no host; there are {', '.join([*names(), OWN])}")
    elif not shutil.which(os.environ.get("BLENDER", "")):
        raise ToolError("BLENDER must be the path of a Blender program, for instance BLENDER=/usr/bin/blender.")


def run_suite(name: str, pytest_arguments: Sequence[str], report: Path | None = None) -> int:
    """Run the suite in a host that is set up; its exit status. `report` is where pytest's XML report goes."""
    if name in bpy_names():
        return run_in_bpy(name, pytest_arguments, report)
    with stage_for(name) as stage:
        install_extension(stage)
        command = [*stage.command, "--background", *script(stage, SUITE, "report.xml", pytest_arguments)]
        status = subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode
        if report and (stage.folder / "report.xml").is_file():
            shutil.copy(stage.folder / "report.xml", report)
    return status


def run_window_suite(name: str, pytest_arguments: Sequence[str], report: Path | None = None) -> int:
    """Run tests/gui in windows of a real program that is set up, a new one for each file of tests; the exit status.

    It is 1 where nothing is wrong but that a program complained on its standard error.
    """
    with stage_for(windows()[name].host) as stage:
        install_extension(stage)
        files = sorted(file.name for file in (ROOT / WINDOW_SUITE).glob("test_*.py"))
        statuses = [run_in_window(stage, name, file, pytest_arguments) for file in files]
        take_pictures(stage, PICTURES / name)
        if report:
            join_reports(sorted(stage.folder.glob("report-*.xml")), report)
    ran = [status for status in statuses if status != NO_TESTS_COLLECTED]
    return max(ran, key=abs) if ran else NO_TESTS_COLLECTED


def run_in_window(stage: Stage, name: str, file: str, pytest_arguments: Sequence[str]) -> int:
    """Run one file of tests; what a program writes to its standard error is shown when it has ended."""
    arguments = script(stage, f"{WINDOW_SUITE}/{file}", f"report-{file}.xml", pytest_arguments)
    command = [*stage.window_command, *windows()[name].arguments, *arguments]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    sys.stderr.write(done.stderr)
    found = complaints(done.stderr)
    if found:
        print(f"Blender complained on its standard error: {'; '.join(found)}", flush=True)
    return done.returncode or int(bool(found))


def join_reports(reports: Sequence[Path], target: Path) -> None:
    """Write the reports of several runs as one."""
    joined = ElementTree.Element("testsuites")
    for report in reports:
        joined.extend(ElementTree.parse(report).getroot())
    ElementTree.ElementTree(joined).write(target)


def run_in_bpy(name: str, pytest_arguments: Sequence[str], report: Path | None) -> int:
    python = environments.ENVIRONMENTS[name].python
    with tempfile.TemporaryDirectory() as settings:
        variables = {**os.environ, "PYTHONPATH": str(environments.PACKAGES), "BLENDER_USER_RESOURCES": settings}
        command = [str(python.with_name("pytest")), *PYTEST_OPTIONS, SUITE, *report_option(report), *pytest_arguments]
        return subprocess.run(command, env=variables, cwd=ROOT, stdin=subprocess.DEVNULL, check=False).returncode


def install_extension(stage: Stage) -> None:
    """Fill the stage, install the zip and enable it for the next start."""
    fill(stage.folder)
    zip_inside = f"{stage.path_inside}/extension.zip"
    run([*stage.command, "--command", "extension", "install-file", "-r", "user_default", "-e", zip_inside])


def script(stage: Stage, tests: str, report: str, pytest_arguments: Sequence[str]) -> list[str]:
    """The arguments with which a program in which the extension was enabled at an earlier start runs tests.

    The report is a file in the stage.
    """
    inside = stage.path_inside
    suite = [f"{inside}/{tests}", "--rootdir", inside, "-c", f"{inside}/pyproject.toml", *PYTEST_OPTIONS]
    suite += ["--junitxml", f"{inside}/{report}", *pytest_arguments]
    return ["--python-exit-code", "1", "--python", f"{inside}/tests/run_in_blender.py", "--", f"{inside}/sites", *suite]


def take_pictures(stage: Stage, folder: Path) -> None:
    """Copy the pictures that tests made for whoever looks into a failure; those of an earlier run are removed."""
    shutil.rmtree(folder, ignore_errors=True)
    if any((stage.folder / "pictures").iterdir()):
        shutil.copytree(stage.folder / "pictures", folder)
        print(f"Pictures are in {folder.relative_to(ROOT)}", flush=True)


def report_option(report: Path | None) -> list[str]:
    return ["--junitxml", str(report)] if report else []


@contextmanager
def stage_for(name: str) -> Iterator[Stage]:
    """An empty folder for one run, and the Blender that will see it."""
    if name == OWN:
        with tempfile.TemporaryDirectory(prefix="meniscus-") as folder:
            settings = ["env", f"BLENDER_USER_RESOURCES={folder}/settings"]
            blender = os.environ["BLENDER"]
            yield Stage(Path(folder), folder, [*settings, blender], [*settings, *under_xvfb(folder), blender])
        return
    system = debian_blender.PROGRAMS[name].folder
    with tempfile.TemporaryDirectory(prefix="meniscus-", dir=system / "tmp") as folder:
        inside = f"/tmp/{Path(folder).name}"
        settings = ["env", f"BLENDER_USER_RESOURCES={inside}/settings"]
        commands = ([*settings, "blender"], [*settings, *under_xvfb(inside), "blender"])
        yield Stage(Path(folder), inside, *(debian_blender.command_inside(system, command) for command in commands))


def under_xvfb(folder: str) -> list[str]:
    """What starts a program with a screen that nobody sees.

    Its pixels are in a file, whose path is in MENISCUS_SCREEN. MENISCUS_PICTURES is a folder for pictures that tests make.
    Each start has a folder for its screen: a server that still goes down would take the file of the next one with it.
    """
    start = f"""
        screen=$(mktemp --directory {folder}/screen/XXXXXX)
        export MENISCUS_SCREEN=$screen/Xvfb_screen0 MENISCUS_PICTURES={folder}/pictures
        exec xvfb-run --auto-servernum "--server-args=-screen 0 1280x800x24 -nocursor -fbdir $screen" "$@"
    """
    return ["sh", "-c", start, "sh"]


def fill(folder: Path) -> None:
    """Put in the stage what a run needs: the zip, pytest, the tests and the samples."""
    for name in STAGED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            (folder / name).parent.mkdir(exist_ok=True)
            shutil.copy(source, folder / name)
    shutil.copytree(ensure_sites(), folder / "sites")
    shutil.copy(built_zip(), folder / "extension.zip")
    for name in ("settings", "screen", "pictures"):
        (folder / name).mkdir()


def built_zip() -> Path:
    zips = list((ROOT / "dist").glob("meniscus-*.zip"))
    if len(zips) != 1:
        raise ToolError(f"There should be one extension zip in dist/, and there are {len(zips)}: run 'make clean extension'.")
    return zips[0]


def ensure_sites() -> Path:
    """A folder that holds what the tests need inside Blender programs, for each version of Python in a folder of its own."""
    lock = REQUIREMENTS / "program.txt"
    sites = CACHE / "sites" / fingerprint(lock, *PYTHONS)
    with locked("sites"):
        if not sites.is_dir():
            partial = sites.with_suffix(".partial")
            shutil.rmtree(partial, ignore_errors=True)
            for version in PYTHONS:
                install_site(lock, version, partial / version)
            partial.rename(sites)
    return sites


def install_site(lock: Path, python: str, folder: Path) -> None:
    install: list[str | Path] = [environments.ensure_uv(), "pip", "install", "--quiet", "--no-deps", "--require-hashes"]
    install += [
        "--only-binary",
        ":all:",
        "--python",
        sys.executable,
        "--python-version",
        python,
        "--target",
        folder,
        "-r",
        lock,
    ]
    run(install, env=environments.uv_variables())


def main(arguments: list[str]) -> int:
    if arguments == ["--list"]:
        print("\n".join([*names(), *windows()]))
        return 0
    report = None
    if arguments[:1] == ["--report"]:
        _, report, *arguments = arguments
    if not arguments:
        raise ToolError(f"say which host: {', '.join([*names(), *windows()])}")
    name, *pytest_arguments = arguments
    if name in windows():
        prepare(windows()[name].host)
        return run_window_suite(name, pytest_arguments)
    prepare(name)
    if report is not None:
        return run_suite(name, pytest_arguments, Path(report))
    statuses = [run_suite(name, pytest_arguments)]
    statuses += [run_window_suite(key, pytest_arguments) for key, window in windows().items() if window.host == name]
    return next(filter(None, statuses), 0)


if __name__ == "__main__":
    command_line(main)
