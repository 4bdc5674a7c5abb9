"""The example that splits a range over processes, with a program in Blender's place; tests/blender has the real one."""

import json
import stat
import sys

import pytest

from meniscus.samples import farm

FAKE = """#!{python}
import json, os, sys
arguments = sys.argv[1:]
frames = [int(n) for n in next(a for a in arguments if a.startswith("--frames=")).split("=")[1].split(",")]
with open("{log}", "a") as log:
    log.write(json.dumps(arguments) + "\\n")
reports = []
for frame in frames:
    if frame == 13 and len(frames) > 1:
        sys.exit("it crashed")
    error = "no luck" if frame == 17 else ""
    reports.append({{"frame": frame, "error": error}})
print("Blender 5.2 said something")
print(json.dumps({{"frames_wanted": len(frames), "error": "", "frames": reports}}))
"""


@pytest.fixture
def program(tmp_path):
    """A program that takes Blender's arguments, and what it was called with."""
    path, log = tmp_path / "blender", tmp_path / "log"
    path.write_text(FAKE.format(python=sys.executable, log=log))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path), lambda: [json.loads(line) for line in log.read_text().splitlines()]


def test_every_frame_is_rendered_once_and_the_rest_again_alone(program, capsys):
    path, calls = program
    arguments = [
        "--blender",
        path,
        "--workers",
        "3",
        "--chunk",
        "4",
        "scene.blend",
        "--frames",
        "1:20",
        "--",
        "--output",
        "//f.exr",
    ]
    assert farm.main(arguments) == 1
    out, err = capsys.readouterr()
    assert "19 of 20 frames are there" in out
    assert err == "Frame 17: no luck\n"
    chunks = [next(a for a in call if a.startswith("--frames=")).removeprefix("--frames=") for call in calls()]
    assert sorted(chunks[:5], key=lambda text: int(text.split(",")[0])) == [
        "1,2,3,4", "5,6,7,8", "9,10,11,12", "13,14,15,16", "17,18,19,20",
    ]  # fmt: skip
    assert sorted(chunks[5:], key=int) == ["13", "14", "15", "16", "17"]
    call = calls()[0]
    assert call[call.index("scene.blend") :][:3] == ["scene.blend", "--command", "meniscus"]
    assert call[-4:] == ["--output", "//f.exr", "--json", "-"]


def test_all_is_well_only_if_every_frame_is_there(program, capsys):
    path, _ = program
    assert farm.main(["--blender", path, "scene.blend", "--frames=-3:3:3"]) == 0
    assert "3 of 3 frames are there" in capsys.readouterr().out


def test_without_blender_it_says_so(tmp_path, capsys):
    assert farm.main(["--blender", str(tmp_path / "none"), "scene.blend", "--frames", "1:2"]) == 1
    assert "cannot be started" in capsys.readouterr().err


def test_a_range_that_is_none(capsys):
    with pytest.raises(SystemExit):
        farm.main(["scene.blend", "--frames", "1-5"])
    assert "'1-5' is no range of frames" in capsys.readouterr().err
