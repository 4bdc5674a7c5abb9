"""Runs the tests in every Blender there is: the bpy wheels, Debian's real programs and the machine's own.

    python3 tools/hosts.py --list                      name the hosts
    python3 tools/hosts.py HOST [PYTEST_ARGUMENT ...]  set one up if need be, and test in it

All run tests/blender without a window; the real programs also run tests/gui, in a window under Xvfb, and in them the built
zip is installed and enabled first and tested at the next start. The machine's own Blender is the host `blender-own`;
BLENDER=/path/to/blender says where it is.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import debian_blender
import environments
from project import CACHE, REQUIREMENTS, ROOT, ToolError, command_line, fingerprint, locked, run

OWN = "blender-own"
SUITE = "tests/blender"
WINDOW_SUITE = "tests/gui"
# What the tests need beside the installed extension.
STAGED = ("tests", "samples", "pyproject.toml")
PYTEST_OPTIONS = ["-p", "no:cacheprovider"]


@dataclass(frozen=True)
class Stage:
    """A folder that a Blender program can see: where it lies, what it is called there, and how the program is started.

    `window_command` starts it with a window that nobody needs to see.
    """

    folder: Path
    path_inside: str
    command: list[str]
    window_command: list[str]


def names() -> list[str]:
    """Every host of this machine; its own Blender only where BLENDER names it."""
    own = [OWN] if os.environ.get("BLENDER") else []
    return [*bpy_names(), *debian_blender.PROGRAMS, *own]


def window_names() -> list[str]:
    """The hosts that can open a window."""
    return [name for name in names() if name not in bpy_names()]


def bpy_names() -> list[str]:
    return [name for name in environments.ENVIRONMENTS if name.startswith("bpy-")]


def prepare(name: str) -> None:
    """Set the host up; quick when it is already."""
    if name in bpy_names():
        environments.ensure(name)
        return
    ensure_pytest_site()
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
        return run_in_program(stage, [*stage.command, "--background"], SUITE, pytest_arguments, report)


def run_window_suite(name: str, pytest_arguments: Sequence[str], report: Path | None = None) -> int:
    """Run tests/gui in a real program that is set up, with a window; its exit status."""
    with stage_for(name) as stage:
        install_extension(stage)
        return run_in_program(stage, stage.window_command, WINDOW_SUITE, pytest_arguments, report)


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


def run_in_program(stage: Stage, program: list[str], tests: str, pytest_arguments: Sequence[str], report: Path | None) -> int:
    """Run tests in a program in which the extension was enabled at an earlier start."""
    inside = stage.path_inside
    suite = [f"{inside}/{tests}", "--rootdir", inside, "-c", f"{inside}/pyproject.toml", *PYTEST_OPTIONS]
    suite += ["--junitxml", f"{inside}/report.xml", *pytest_arguments]
    script = ["--python-exit-code", "1", "--python", f"{inside}/tests/run_in_blender.py", "--", f"{inside}/site", *suite]
    status = subprocess.run([*program, *script], stdin=subprocess.DEVNULL, check=False).returncode
    if report and (stage.folder / "report.xml").is_file():
        shutil.copy(stage.folder / "report.xml", report)
    return status


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
    """What starts a program with a screen that nobody sees; its pixels are in a file, whose path is in MENISCUS_SCREEN."""
    screen = f"--server-args=-screen 0 1280x800x24 -nocursor -fbdir {folder}/screen"
    return [f"MENISCUS_SCREEN={folder}/screen/Xvfb_screen0", "xvfb-run", "--auto-servernum", screen]


def fill(folder: Path) -> None:
    """Put in the stage what a run needs: the zip, pytest, the tests and the samples."""
    for name in STAGED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    shutil.copytree(ensure_pytest_site(), folder / "site")
    shutil.copy(built_zip(), folder / "extension.zip")
    (folder / "settings").mkdir()
    (folder / "screen").mkdir()


def built_zip() -> Path:
    zips = list((ROOT / "dist").glob("meniscus-*.zip"))
    if len(zips) != 1:
        raise ToolError(f"There should be one extension zip in dist/, and there are {len(zips)}: run 'make clean extension'.")
    return zips[0]


def ensure_pytest_site() -> Path:
    """A folder with pytest, for the Pythons inside Blender programs; all of it is pure Python."""
    lock = REQUIREMENTS / "pytest.txt"
    site = CACHE / "pytest" / fingerprint(lock)
    with locked("pytest"):
        if not site.is_dir():
            partial = site.with_suffix(".partial")
            shutil.rmtree(partial, ignore_errors=True)
            install: list[str | Path] = [
                environments.ensure_uv(),
                "pip",
                "install",
                "--quiet",
                "--no-deps",
                "--require-hashes",
                "-r",
                lock,
            ]
            run([*install, "--python", sys.executable, "--target", partial], env=environments.uv_variables())
            partial.rename(site)
    return site


def main(arguments: list[str]) -> int:
    if arguments == ["--list"]:
        print("\n".join(names()))
        return 0
    if not arguments:
        raise ToolError(f"say which host: {', '.join(names())}")
    name, *pytest_arguments = arguments
    prepare(name)
    status = run_suite(name, pytest_arguments)
    if name in window_names():
        status = run_window_suite(name, pytest_arguments) or status
    return status


if __name__ == "__main__":
    command_line(main)
