"""`blender -b scene.blend --command meniscus render ...`: what it writes, says and returns."""

import importlib
import json
import os
import re
import resource
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import bpy
import numpy as np
import pytest

EXR_MAGIC = b"\x76\x2f\x31\x01"


class Result(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


Run = Callable[..., Result]


def submodule(meniscus: ModuleType, name: str) -> ModuleType:
    return importlib.import_module(f"{meniscus.__name__}.addon.{name}")


def add_camera(scene: bpy.types.Scene, name: str, location: tuple[float, float, float]) -> bpy.types.Object:
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    camera.location, camera.rotation_euler = location, (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    return camera


@pytest.fixture
def fluid_scene(empty_scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    """Three balls that move from frame to frame, seen by a camera, saved in `tmp_path`."""
    mesh = bpy.data.meshes.new("Balls")
    mesh.from_pydata([(0, 0, 0), (0.5, 0, 0), (0, 0.6, 0.3)], [], [])
    source = bpy.data.objects.new("Balls", mesh)
    empty_scene.collection.objects.link(source)
    source.meniscus.use_fluid = True
    source.meniscus.radius_mode = "FIXED"
    source.meniscus.radius = 1.0
    source.keyframe_insert("location", frame=1)
    source.location.x = 1.0
    source.keyframe_insert("location", frame=5)
    empty_scene.camera = add_camera(empty_scene, "Front", (0, -6, 0))
    add_camera(empty_scene, "Low", (0, -6, -0.5))
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 48, 32
    empty_scene.frame_start, empty_scene.frame_end = 1, 3
    empty_scene.meniscus.backend = "cpu"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return empty_scene


@pytest.fixture
def run(meniscus: ModuleType, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `--command meniscus ARGUMENTS` in this process."""

    def run_command(*arguments: str) -> Result:
        capsys.readouterr()
        status = submodule(meniscus, "blender.command_line").main(list(arguments))
        return Result(status, *capsys.readouterr())

    return run_command


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def channel_names(path: Path) -> set[str]:
    """Read from the header's bytes, because the OpenEXR package crashes inside some builds of Blender."""
    head = path.read_bytes()
    assert head.startswith(EXR_MAGIC)
    start = head.index(b"chlist\0") + len(b"chlist\0") + 4
    names = set()
    while end := head.index(b"\0", start) - start:
        names.add(head[start : start + end].decode())
        start += end + 1 + 16
    return names


def attribute(path: Path, name: str, kind: str, length: int) -> bytes:
    return path.read_bytes().partition(f"{name}\0{kind}\0".encode())[2][4 : 4 + length]


def image_size(path: Path) -> tuple[int, int]:
    corners = np.frombuffer(attribute(path, "displayWindow", "box2i", 16), np.int32)
    return int(corners[2] + 1), int(corners[3] + 1)


def test_the_scenes_frame_range_is_rendered_to_files_beside_the_blend_file(
    fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path
) -> None:
    result = run("render", "--output", "//passes/fluid_####.exr")
    assert result.status == 0
    assert result.err == ""
    assert names_in(tmp_path / "passes") == {"fluid_0001.exr", "fluid_0002.exr", "fluid_0003.exr"}
    lines = [line for line in result.out.splitlines() if line.startswith("Frame ")]
    assert [line.split(":")[0] for line in lines] == ["Frame 1 (1/3)", "Frame 2 (2/3)", "Frame 3 (3/3)"]
    assert all("3 balls" in line and " ms, CPU" in line for line in lines)
    assert result.out.endswith("Meniscus wrote 3 of 3 frames\n")
    assert channel_names(tmp_path / "passes" / "fluid_0001.exr") == {f"ViewLayer.{name}" for name in DEPTH_AND_NORMAL}


DEPTH_AND_NORMAL = ("Depth.Z", "Normal.X", "Normal.Y", "Normal.Z")


def test_each_file_holds_the_image_of_its_frame(
    meniscus: ModuleType, fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path
) -> None:
    assert run("render", "--output", "//####.exr", "--frames", "4,2").status == 0
    for frame in (2, 4):
        fluid_scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        read_scene = submodule(meniscus, "blender.read_scene")
        camera = submodule(meniscus, "blender.read_camera").read_camera(depsgraph)
        image = meniscus.render(
            read_scene.read_fluid(depsgraph).balls, camera, read_scene.read_field(fluid_scene), backend="cpu"
        )
        assert image.hit.any()
        content = submodule(meniscus, "output.exr_content")
        options = content.ExrOptions(frame=frame, frames_per_second=24.0)
        with submodule(meniscus, "output.exr_process").ExrProcess() as writer:
            writer.write(tmp_path / "expected.exr", content.flat_content(image, options)).result()
        assert (tmp_path / f"{frame:04}.exr").read_bytes() == (tmp_path / "expected.exr").read_bytes()
    assert (tmp_path / "0002.exr").read_bytes() != (tmp_path / "0004.exr").read_bytes()


def test_a_pattern_without_hashes_gets_the_frame_number_only_for_several_frames(
    fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path
) -> None:
    assert run("render", "--output", str(tmp_path / "a" / "still"), "--frames", "2").status == 0
    assert names_in(tmp_path / "a") == {"still.exr"}
    assert run("render", "--output", str(tmp_path / "b" / "moving.exr"), "--frames", "2:3").status == 0
    assert names_in(tmp_path / "b") == {"moving0002.exr", "moving0003.exr"}


def test_resolution_passes_and_compression_are_the_callers(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    options = ("--resolution", "20x10", "--passes", "position,combined", "--compression", "NONE")
    assert run("render", "--output", "//a.exr", "--frames", "1", *options).status == 0
    assert image_size(tmp_path / "a.exr") == (20, 10)
    expected = {f"ViewLayer.Position.{letter}" for letter in "XYZ"} | {f"ViewLayer.Combined.{letter}" for letter in "RGBA"}
    assert channel_names(tmp_path / "a.exr") == expected
    assert attribute(tmp_path / "a.exr", "compression", "compression", 1) == b"\0"


@pytest.mark.parametrize(("mode", "threads"), [("FIXED", 3), ("AUTO", 0)])
def test_the_scenes_threads_are_used(
    meniscus: ModuleType,
    fluid_scene: bpy.types.Scene,
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    mode: str,
    threads: int,
) -> None:
    fluid_scene.render.threads_mode = mode
    if mode == "FIXED":
        fluid_scene.render.threads = threads
    module = submodule(meniscus, "blender.render_scene")
    render, asked = module.render, []

    def recording(*arguments: object, **options: object) -> object:
        asked.append(options["threads"])
        return render(*arguments, **options)

    monkeypatch.setattr(module, "render", recording)
    assert run("render", "--output", str(tmp_path / "fluid.exr"), "--frames", "1").status == 0
    assert asked == [threads]


def test_the_resolution_percentage_counts(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    fluid_scene.render.resolution_percentage = 50
    assert run("render", "--output", "//a.exr", "--frames", "1").status == 0
    assert image_size(tmp_path / "a.exr") == (24, 16)


def test_another_camera_sees_something_else(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    assert run("render", "--output", "//front.exr", "--frames", "1").status == 0
    assert run("render", "--output", "//low.exr", "--frames", "1", "--camera", "Low").status == 0
    matrices = [
        np.frombuffer(attribute(tmp_path / name, "worldToCamera", "m44f", 64), np.float32).reshape(4, 4)
        for name in ("front.exr", "low.exr")
    ]
    assert matrices[0][3] == pytest.approx([0, 0, 6, 1], abs=1e-5)
    assert matrices[1][3] == pytest.approx([0, 0.5, 6, 1], abs=1e-5)


def test_another_view_layer_sees_its_own_objects(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    spray = bpy.data.collections.new("Spray")
    fluid_scene.collection.children.link(spray)
    extra = fluid_scene.objects["Balls"].copy()
    spray.objects.link(extra)
    fluid_scene.view_layers[0].layer_collection.children["Spray"].exclude = True
    fluid_scene.view_layers.new("With Spray")
    options = ("--frames", "1", "--json", str(tmp_path / "report.json"))
    balls = []
    for view_layer in (fluid_scene.view_layers[0].name, "With Spray"):
        assert run("render", "--output", "//a.exr", *options, "--view-layer", view_layer).status == 0
        balls.append(json.loads((tmp_path / "report.json").read_text())["frames"][0]["balls"])
        assert channel_names(tmp_path / "a.exr") == {f"{view_layer}.{name}" for name in DEPTH_AND_NORMAL}
    assert balls == [3, 6]


def test_a_preview_shows_the_fluid_in_front_of_grey(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    fluid_scene.meniscus.render_style, fluid_scene.render.film_transparent = "headlight", True
    assert run("render", "--output", "//a.exr", "--frames", "1", "--preview").status == 0
    assert names_in(tmp_path) >= {"a.exr", "a.png"}
    assert channel_names(tmp_path / "a.exr") == {f"ViewLayer.{name}" for name in DEPTH_AND_NORMAL}
    picture = bpy.data.images.load(str(tmp_path / "a.png"))
    pixels = np.array(picture.pixels, np.float32).reshape(32, 48, 4)
    red, green, blue, alpha = pixels[16, 24]
    assert blue > green > red
    assert pixels[0, 0, 0] == pixels[0, 0, 1] == pixels[0, 0, 2]
    assert alpha == 1


def test_the_report_tells_about_every_frame(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    report_path = tmp_path / "reports" / "report.json"
    assert run("render", "--output", "//####.exr", "--frames", "1:2", "--json", str(report_path)).status == 0
    report = json.loads(report_path.read_text())
    assert (report["frames_wanted"], report["error"]) == (2, "")
    assert [frame["path"] for frame in report["frames"]] == [str(tmp_path / "0001.exr"), str(tmp_path / "0002.exr")]
    for frame in report["frames"]:
        assert (frame["balls"], frame["dropped"], frame["backend"], frame["error"]) == (3, {}, "cpu", "")
        assert frame["device"].startswith("CPU")
        assert {"scene", "read", "build", "cast", "passes", "write"} <= set(frame["milliseconds"])


def test_a_report_on_the_standard_output_stands_alone_there(fluid_scene: bpy.types.Scene, run: Run) -> None:
    result = run("render", "--output", "//####.exr", "--frames", "1:2", "--json", "-")
    assert result.out.count("\n") == 1
    assert [frame["frame"] for frame in json.loads(result.out)["frames"]] == [1, 2]
    assert "Frame 2 (2/2)" in result.err


def test_unusable_balls_are_counted_and_the_rest_is_rendered(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    fluid_scene.objects["Balls"].data.vertices[2].co.x = float("nan")
    result = run("render", "--output", "//####.exr", "--frames", "1:2", "--json", str(tmp_path / "report.json"))
    assert result.status == 0
    assert "Frame 1 (1/2): 1 ball was left out: 1 whose position is not finite" in result.err
    assert result.out.splitlines()[-1].endswith("2 balls were left out because their position is not finite")
    frames = json.loads((tmp_path / "report.json").read_text())["frames"]
    assert [(frame["balls"], frame["dropped"]) for frame in frames] == [(2, {"position is not finite": 1})] * 2


def no_camera(scene: bpy.types.Scene) -> None:
    scene.camera = None


def panoramic_camera(scene: bpy.types.Scene) -> None:
    scene.camera.data.type = "PANO"


def no_source(scene: bpy.types.Scene) -> None:
    scene.objects["Balls"].meniscus.use_fluid = False
    scene.objects["Balls"].update_tag()


def unchanged(_: bpy.types.Scene) -> None:
    pass


@pytest.mark.parametrize(
    ("change", "arguments", "status", "sentence"),
    [
        (no_camera, (), 1, "has no camera"),
        (panoramic_camera, (), 1, "is panoramic"),
        (no_source, (), 1, "No object supplies balls"),
        (unchanged, ("--camera", "Nobody"), 1, "The scene has no object 'Nobody' to use as its camera"),
        (unchanged, ("--camera", "Balls"), 1, "'Balls' is not a camera"),
        (unchanged, ("--view-layer", "Nothing"), 1, "The scene has no view layer 'Nothing': choose from ViewLayer"),
        (unchanged, ("--method", "voxels"), 1, "Unknown method 'voxels': choose"),
        (unchanged, ("--backend", "tpu"), 1, "Unknown back-end 'tpu': choose"),
        (unchanged, ("--frames", "3:1"), 2, "the range '3:1' runs backwards"),
        (unchanged, ("--passes", "mist"), 2, "Unknown pass 'mist'"),
        (unchanged, ("--output", "//"), 1, "'//' is a folder; add a file name such as fluid_####.exr"),
        (unchanged, ("--output", "//scene.blend/a.exr"), 1, "Cannot make the folder"),
    ],
)
def test_bad_input_gives_one_sentence_and_writes_nothing(
    fluid_scene: bpy.types.Scene,
    run: Run,
    tmp_path: Path,
    change: Callable[[bpy.types.Scene], None],
    arguments: tuple[str, ...],
    status: int,
    sentence: str,
) -> None:
    change(fluid_scene)
    before = names_in(tmp_path)
    result = run("render", "--output", "//out_####.exr", *arguments)
    assert result.status == status
    assert result.err.startswith("meniscus: ")
    assert result.err.count("\n") == 1
    assert sentence in result.err
    assert names_in(tmp_path) == before


def test_an_unsaved_scene_has_no_folder_to_be_relative_to(empty_scene: bpy.types.Scene, run: Run) -> None:
    result = run("render", "--output", "//a.exr")
    assert result.status == 1
    assert result.err == "meniscus: '//a.exr' is relative to the .blend file, but none is open; give an absolute path\n"


def test_an_unwritable_report_fails_the_command(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    result = run("render", "--output", "//a.exr", "--frames", "1", "--json", str(tmp_path / "scene.blend" / "report.json"))
    assert result.status == 1
    assert "Cannot make the folder" in result.err


def test_a_full_disk_keeps_the_old_files_and_fails_the_command(fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path) -> None:
    for frame in (1, 2):
        (tmp_path / f"000{frame}.exr").write_bytes(b"old")
    before = names_in(tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A limit on the size of files makes the system refuse the write in the middle, as a full disk does.
    resource.setrlimit(resource.RLIMIT_FSIZE, (8000, hard))
    try:
        result = run("render", "--output", "//####.exr", "--frames", "1:2,4:9", "--compression", "NONE")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert result.status == 1
    assert 1 <= result.err.count("the disk is full; free some space or choose another folder\n") <= 4
    assert re.fullmatch(r"Meniscus wrote 0 of 8 frames; \d failed; \d were not rendered\n", result.out)
    assert names_in(tmp_path) == before
    assert (tmp_path / "0001.exr").read_bytes() == b"old"


def test_a_killed_child_costs_one_frame_and_no_old_file(
    meniscus: ModuleType, fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "0002.exr").write_bytes(b"old")
    child = submodule(meniscus, "output.exr_process")._Child
    write = child.write

    def write_to_killed(self: object, path: Path, content: object) -> bool:
        if path.name == "0002.exr":
            self._process.kill()
            self._process.wait()
        return write(self, path, content)

    monkeypatch.setattr(child, "write", write_to_killed)
    result = run("render", "--output", "//####.exr")
    assert result.status == 1
    assert result.err.startswith("Frame 2 (2/3): Cannot write ")
    assert "the process that writes EXR files ended early" in result.err
    assert result.out.endswith("Meniscus wrote 2 of 3 frames; 1 failed\n")
    assert (tmp_path / "0002.exr").read_bytes() == b"old"
    assert channel_names(tmp_path / "0003.exr")


def test_a_frame_that_cannot_be_rendered_does_not_stop_the_others(
    meniscus: ModuleType, fluid_scene: bpy.types.Scene, run: Run, tmp_path: Path
) -> None:
    camera = fluid_scene.camera.data
    for frame, clip_end in ((1, 100.0), (2, 0.05), (3, 100.0)):
        camera.clip_end = clip_end
        camera.keyframe_insert("clip_end", frame=frame)
    result = run("render", "--output", "//####.exr", "--json", str(tmp_path / "report.json"))
    assert result.status == 1
    assert result.err.startswith("Frame 2 (2/3): The camera's clip start")
    assert result.out.endswith("Meniscus wrote 2 of 3 frames; 1 failed\n")
    assert names_in(tmp_path) >= {"0001.exr", "0003.exr"}
    assert not (tmp_path / "0002.exr").exists()
    assert [bool(frame["error"]) for frame in json.loads((tmp_path / "report.json").read_text())["frames"]] == [
        False,
        True,
        False,
    ]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_the_command_with_whole_files_only(
    meniscus: ModuleType,
    fluid_scene: bpy.types.Scene,
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: signal.Signals,
) -> None:
    handler = signal.getsignal(number)
    render_scene = submodule(meniscus, "blender.render_scene")
    render = render_scene.render

    def interrupted_render(*arguments: object, **options: object) -> object:
        if fluid_scene.frame_current == 2:
            signal.raise_signal(number)
        return render(*arguments, **options)

    monkeypatch.setattr(render_scene, "render", interrupted_render)
    result = run("render", "--output", "//####.exr")
    assert result.status == 1
    assert result.err == "meniscus: The render was cancelled\n"
    assert result.out.endswith("Meniscus wrote 1 of 3 frames; 2 were not rendered\n")
    assert channel_names(tmp_path / "0001.exr")
    assert not (tmp_path / "0002.exr").exists()
    assert signal.getsignal(number) == handler


def test_the_command_is_registered_once_under_its_name(meniscus: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    command_line = submodule(meniscus, "blender.command_line")
    calls = []
    monkeypatch.setattr(bpy.utils, "register_cli_command", lambda *arguments: calls.append(arguments) or "handle")
    monkeypatch.setattr(bpy.utils, "unregister_cli_command", calls.append)
    command_line.register()
    command_line.unregister()
    assert calls == [("meniscus", command_line.main), "handle"]


if bpy.app.binary_path:  # Only the real program has a command line.

    def blender(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([bpy.app.binary_path, *arguments], capture_output=True, text=True, check=False)

    def test_blender_itself_runs_the_command(fluid_scene: bpy.types.Scene, tmp_path: Path) -> None:
        done = blender(
            *("-b", str(tmp_path / "scene.blend"), "--command", "meniscus"),
            *("render", "--frames", "1:2", "--output", "//####.exr", "--preview"),
        )
        assert done.returncode == 0, done.stderr
        assert "Meniscus wrote 2 of 2 frames" in done.stdout
        assert names_in(tmp_path) >= {"0001.exr", "0002.exr", "0001.png", "0002.png"}

    def test_blender_itself_returns_the_exit_status(fluid_scene: bpy.types.Scene, tmp_path: Path) -> None:
        done = blender(
            "-b", str(tmp_path / "scene.blend"), "--command", "meniscus", "render", "--frames", "2:1", "--output", "//a"
        )
        assert done.returncode == 2
        assert "runs backwards" in done.stderr

    def test_ctrl_c_stops_blender_itself(fluid_scene: bpy.types.Scene, tmp_path: Path) -> None:
        running = subprocess.Popen(
            [bpy.app.binary_path, "-b", str(tmp_path / "scene.blend"), "--command", "meniscus"]
            + ["render", "--frames", "1:100000", "--output", "//####.exr"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        for line in running.stdout:
            if line.startswith("Frame 3 "):
                os.killpg(running.pid, signal.SIGINT)
        assert running.wait() == 1
        assert "The render was cancelled" in running.stderr.read()
        assert all(path.read_bytes().startswith(EXR_MAGIC) for path in tmp_path.glob("*.exr"))
        assert not list(tmp_path.glob(".*.tmp*"))
