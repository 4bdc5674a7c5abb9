"""The tools that set up and test: what goes wrong there must be noticed."""

from contextlib import nullcontext
from pathlib import Path

import debian_blender
import environments
import hosts
import project
import pytest
import run_tests
from complaints import complaints


def report(path: Path, **counts: int) -> None:
    attributes = " ".join(f'{name}="{count}"' for name, count in counts.items())
    path.write_text(f"<testsuites><testsuite {attributes}/></testsuites>")


@pytest.fixture
def reports(tmp_path, monkeypatch):
    monkeypatch.setattr(run_tests, "REPORTS", tmp_path)
    monkeypatch.delenv("CI", raising=False)
    return tmp_path


def test_counts_come_from_the_report(reports):
    report(reports / "unit.xml", tests=10, failures=2, errors=1, skipped=3)
    result = run_tests.result_of("unit", 1)
    assert (result.passed, result.failed, result.skipped, result.problem) == (4, 3, 3, "")


@pytest.mark.parametrize(("status", "counts"), [(5, {"tests": 0}), (-11, {"tests": 4}), (3, None)])
def test_a_run_without_tests_or_with_a_crash_fails(reports, status, counts):
    if counts:
        report(reports / "unit.xml", **counts)
    result = run_tests.result_of("unit", status)
    assert result.failed == 1
    assert result.problem
    assert run_tests.summarise([result]) == 1


def test_a_missing_host_is_shown_in_a_box_and_fails_in_ci(reports, monkeypatch, capsys):
    results = [run_tests.Result("unit", passed=3), run_tests.Result("blender-5.2", problem="no root", is_missing=True)]
    assert run_tests.summarise(results) == 0
    output = capsys.readouterr().out
    assert "# NOT TESTED in blender-5.2: no root #" in output
    assert output.splitlines()[-1] == "tests: 3 passed, 0 failed, 0 skipped"
    monkeypatch.setenv("CI", "true")
    assert run_tests.summarise(results) == 1


def test_a_python_that_does_not_run_is_passed_over(tmp_path, monkeypatch):
    shims, real = tmp_path / "shims", tmp_path / "real"
    for folder, line in ((shims, "exit 127"), (real, "echo 3.13")):
        folder.mkdir()
        (folder / "python3.13").write_text(f"#!/bin/sh\n{line}\n")
        (folder / "python3.13").chmod(0o755)
    monkeypatch.setenv("PATH", f"{shims}:{real}:/usr/bin:/bin")
    assert environments.find_python("3.13") == str(real / "python3.13")


def test_an_environment_without_a_stamp_or_an_interpreter_is_made_anew(tmp_path):
    environment = environments.Environment(tmp_path / "environment", {})
    assert environments.stamp_of(environment) == ""
    environment.python.parent.mkdir(parents=True)
    (environment.folder / environments.STAMP).write_text("whole")
    assert environments.stamp_of(environment) == ""
    environment.python.touch()
    assert environments.stamp_of(environment) == "whole"


def test_a_system_with_a_live_mount_is_not_deleted(tmp_path, monkeypatch):
    monkeypatch.setattr(debian_blender, "mounts_below", lambda folder: [f"{folder}/proc"])
    with pytest.raises(project.ToolError, match="unmount it first"):
        debian_blender.remove_system(tmp_path)
    assert tmp_path.is_dir()


def test_mounts_are_found():
    # Every Linux has devices such as /dev/pts or /dev/shm mounted there.
    assert debian_blender.mounts_below(Path("/dev"))
    assert debian_blender.mounts_below(Path("/de")) == []


def test_what_fails_is_one_sentence_with_the_command():
    with pytest.raises(project.ToolError, match="This command failed: sh -c echo broken"):
        project.output_of(["sh", "-c", "echo broken >&2; exit 2"])


def test_reports_of_several_runs_count_together(reports):
    for number in (1, 2):
        report(reports / f"part-{number}.xml", tests=3, failures=number)
    hosts.join_reports(sorted(reports.glob("part-*.xml")), reports / "window.xml")
    result = run_tests.result_of("window", 1)
    assert (result.passed, result.failed) == (3, 3)


@pytest.mark.parametrize(("statuses", "expected"), [([0, 5], 0), ([5, 5], 5), ([0, 1], 1), ([0, -11, 5], -11)])
def test_the_worst_status_of_a_window_suite_counts(tmp_path, monkeypatch, statuses, expected):
    left = iter(statuses)
    stage = hosts.Stage(tmp_path, "/stage", ["blender"], ["blender"])
    (tmp_path / "pictures").mkdir()
    for index in range(len(statuses)):
        (tmp_path / hosts.WINDOW_SUITE).mkdir(parents=True, exist_ok=True)
        (tmp_path / hosts.WINDOW_SUITE / f"test_{index}.py").touch()
    monkeypatch.setattr(hosts, "ROOT", tmp_path)
    monkeypatch.setattr(hosts, "PICTURES", tmp_path / "out")
    monkeypatch.setattr(hosts, "stage_for", lambda host: nullcontext(stage))
    monkeypatch.setattr(hosts, "install_extension", lambda stage: None)
    monkeypatch.setattr(hosts, "run_in_window", lambda *_: next(left))
    assert hosts.run_window_suite("blender-5.2-vulkan", []) == expected


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("Saved session recovery\nBlender quit\n", 0),
        ("Traceback (most recent call last):\n  File ...\nValueError: x\n", 1),
        ("GPUShader: linking error\nGL_INVALID_OPERATION in glDraw\n", 2),
        ("Error: Not freed memory blocks: 3, total 0.1 MB\n", 1),
    ],
)
def test_what_a_blender_must_not_say_is_found(text, count):
    assert len(complaints(text)) == count
