"""Ranges of frames in files: layouts, names, what is there already, what was killed; by the command line and the operator."""

import importlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from exr_files import exr_channels
from fluid_scenes import add_object, add_points


@pytest.fixture
def scene(empty_scene, tmp_path):
    """A fluid before a camera, three frames, saved in `tmp_path`."""
    add_points(empty_scene.collection, "Fluid", [(0, 0, 0), (0.6, 0, 0.2)], 1.0)
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    empty_scene.camera = camera
    render = empty_scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 32, 100
    empty_scene.frame_start, empty_scene.frame_end = 1, 3
    empty_scene.meniscus.render_samples = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return empty_scene


@pytest.fixture
def run(meniscus, capsys):
    """Runs ``--command meniscus render``; exit status, standard output and standard error."""

    def run_command(*arguments):
        capsys.readouterr()
        status = importlib.import_module(f"{meniscus.__name__}.addon.blender.command_line").main(["render", *arguments])
        return (status, *capsys.readouterr())

    return run_command


def names(folder, pattern="*.exr"):
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob(pattern))


def test_each_pass_in_a_file_of_its_own(scene, run, tmp_path):
    status, *_ = run("--output", "//{pass}/f_####.exr", "--frames", "2", "--passes", "depth,ball_id", "--layout", "passes")
    assert status == 0
    assert names(tmp_path) == ["Ball ID/f_0002.exr", "Depth/f_0002.exr"]
    assert set(exr_channels(tmp_path / "Depth" / "f_0002.exr")) == {"ViewLayer.Depth.Z"}


@pytest.mark.parametrize("layout", ["multilayer", "multipart"])
def test_all_passes_in_one_file(scene, run, tmp_path, layout):
    assert run("--output", "//f.exr", "--frames", "1", "--passes", "depth,normal,combined", "--layout", layout)[0] == 0
    assert len(exr_channels(tmp_path / "f.exr")) == 8


def test_a_deep_file_beside_the_flat_one(scene, run, tmp_path):
    assert run("--output", "//f_####.exr", "--frames", "1", "--deep", "--compression", "PIZ")[0] == 0
    assert names(tmp_path) == ["f_0001.exr", "f_deep_0001.exr"]
    assert (tmp_path / "f_deep_0001.exr").read_bytes()[5] & 8, "the bit of deep files"
    assert run("--output", "//{pass}/f.exr", "--frames", "1", "--deep", "--layout", "passes", "--passes", "depth")[0] == 0
    assert names(tmp_path, "f.exr") == ["Depth/f.exr", "deep/f.exr"]


@pytest.fixture
def path_of(meniscus):
    """The path that an output stands for at a frame, where there are several frames."""
    names = ("blender.output_pattern", "blender.render_scene", "output.file_names")
    pattern, rendering, files = (importlib.import_module(f"{meniscus.__name__}.addon.{name}") for name in names)

    def path(output, scene, frame):
        settings = rendering.RenderSettings(passes=("depth",))
        return str(files.frame_path(pattern.output_pattern(output, scene, scene.view_layers[0], settings, 2), frame))

    return path


def test_tokens_name_files(scene, run, tmp_path):
    output = "//{blend_name}_{scene_name}_{camera_name}_{view_layer}_{fps:##}_{resolution_x}x{resolution_y}_####"
    assert run("--output", output, "--frames", "3", "--resolution", "20x10")[0] == 0
    assert names(tmp_path) == ["scene_Scene_Camera_ViewLayer_24_20x10_0003.exr"]
    status, _, error = run("--output", "//{shot}.exr", "--frames", "3")
    assert status == 1
    assert "Unknown token {shot}" in error


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Blender's own paths have tokens since 5.0")
@pytest.mark.parametrize(
    "output",
    [
        "//{blend_name}_{blend_name_lib}_####.exr",
        "{blend_dir}/{blend_dir_lib}x/####.exr",
        "//{camera_name}/{scene_name}/f####.exr",
        "//{fps}_{fps:###}_{fps:.###}_{fps:###.##}_##.exr",
        "//{resolution_x}x{resolution_y}_{resolution_x:######}_{resolution_y:.##}_##.exr",
        "//{{a}}_##.exr",
    ],
)
def test_tokens_are_those_of_blenders_own_paths(scene, path_of, tmp_path, output):
    (tmp_path / "folder {x}").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "folder {x}" / "a {b}.blend"))
    scene.name, scene.camera.name = 'Sea: "2"', "..."
    render = scene.render
    render.fps, render.fps_base = 24, 1.001
    render.resolution_x, render.resolution_percentage = 101, 50
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format = "OPEN_EXR"
    render.filepath = output
    assert path_of(output, scene, 7) == render.frame_path(frame=7)


def test_files_that_are_there_stay(scene, run, tmp_path):
    (tmp_path / "0002.exr").write_bytes(b"whole")
    status, out, _ = run("--output", "//####.exr", "--no-overwrite")
    assert status == 0
    assert "Frame 2 (2/3): left out" in out
    assert "Meniscus wrote 2 of 3 frames; 1 were there or claimed" in out
    assert (tmp_path / "0002.exr").read_bytes() == b"whole"
    scene.render.use_overwrite = False
    assert "wrote 0 of 3 frames" in run("--output", "//####.exr")[1]
    assert "wrote 3 of 3 frames" in run("--output", "//####.exr", "--overwrite")[1]


def test_a_preview_that_is_missing_is_made_up_for(scene, run, tmp_path):
    (tmp_path / "0001.exr").write_bytes(b"whole")
    arguments = ("--output", "//####.exr", "--frames", "1", "--no-overwrite", "--preview")
    assert "Meniscus wrote 1 of 1 frames" in run(*arguments)[1]
    assert (tmp_path / "0001.exr").read_bytes() == b"whole"
    assert (tmp_path / "0001.png").read_bytes().startswith(b"\x89PNG")
    assert "Meniscus wrote 0 of 1 frames; 1 were there or claimed" in run(*arguments)[1]


def test_farm_managers_are_told_what_blender_tells_them(scene, run, tmp_path):
    (tmp_path / "0001.exr").write_bytes(b"whole")
    _, out, _ = run("--output", "//####.exr", "--frames", "1:2", "--no-overwrite", "--deep")
    lines = out.splitlines()
    assert [line for line in lines if line.startswith("Saved: ")] == [
        f"Saved: '{tmp_path}/deep_0001.exr'", f"Saved: '{tmp_path}/0002.exr'", f"Saved: '{tmp_path}/deep_0002.exr'",
    ]  # fmt: skip
    assert len([line for line in lines if re.fullmatch(r"Time: [0-9]{2}:[0-9]{2}\.[0-9]{2}", line)]) == 2
    _, out, _ = run("--output", "//####.exr", "--frames", "1", "--no-overwrite")
    assert f'skipping existing frame "{tmp_path}/0001.exr"' in out.splitlines()


def test_each_folder_of_passes_is_tried_before_anything_is_rendered(scene, run, tmp_path):
    (tmp_path / "Normal").write_text("no folder")
    status, out, error = run("--output", "//{pass}/f_####.exr", "--passes", "depth,normal", "--layout", "passes")
    assert status == 1
    assert error.startswith("meniscus: Cannot make the folder")
    assert error.count("\n") == 1
    assert "0 of 3 frames; 3 were not rendered" in out


def test_only_what_is_missing_of_a_frame_is_written(scene, run, tmp_path):
    (tmp_path / "f_0001.exr").write_bytes(b"whole")
    assert run("--output", "//f_####.exr", "--frames", "1", "--deep", "--no-overwrite", "--placeholders")[0] == 0
    assert (tmp_path / "f_0001.exr").read_bytes() == b"whole"
    assert (tmp_path / "f_deep_0001.exr").stat().st_size > 100


def test_steps_of_the_scene_count(scene, run, tmp_path):
    scene.frame_end, scene.frame_step = 7, 3
    assert run("--output", "//####.exr")[0] == 0
    assert names(tmp_path) == ["0001.exr", "0004.exr", "0007.exr"]


def test_placeholders_keep_others_away(scene, run, tmp_path, meniscus, monkeypatch):
    claims = importlib.import_module(f"{meniscus.__name__}.addon.output.claims")
    render_scene = importlib.import_module(f"{meniscus.__name__}.addon.blender.render_scene")
    render, seen = render_scene.render, []

    def watched_render(*arguments, **options):
        seen.append({path.name: path.stat().st_size for path in tmp_path.glob("*.exr")})
        return render(*arguments, **options)

    monkeypatch.setattr(render_scene, "render", watched_render)
    (tmp_path / "0002.exr").write_bytes(b"Meniscus renders this frame: some-other-computer 1")
    assert run("--output", "//####.exr", "--no-overwrite", "--placeholders")[0] == 0
    assert 0 < seen[0]["0001.exr"] < 100, "claimed before it was rendered"
    assert len(seen) == 2
    assert (tmp_path / "0002.exr").read_bytes().startswith(b"Meniscus renders")
    assert claims.is_taken(tmp_path / "0003.exr")


def test_a_failed_frame_leaves_no_placeholder(scene, run, tmp_path):
    scene.camera.data.clip_end = 0.01
    status, _, error = run("--output", "//####.exr", "--no-overwrite", "--placeholders")
    assert status == 1
    assert "clip" in error
    assert names(tmp_path) == []


def test_a_killed_range_is_finished_by_the_next_run(scene, run, tmp_path):
    """What a killed process leaves are whole files, claims and hidden temporaries; the last two count for nothing."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    host = re.sub(r"\W", "-", socket.gethostname())
    (tmp_path / "0001.exr").write_bytes(b"whole")
    (tmp_path / "0002.exr").write_bytes(f"Meniscus renders this frame: {host} {ended.pid}".encode())
    leftover = tmp_path / f".0002.{host}.{ended.pid}.tmp.exr"
    leftover.write_bytes(b"half")
    status, out, _ = run("--output", "//####.exr", "--no-overwrite", "--placeholders")
    assert status == 0
    assert "Meniscus wrote 2 of 3 frames; 1 were there or claimed" in out
    assert exr_channels(tmp_path / "0002.exr")
    assert not leftover.exists()


@pytest.mark.skipif(not bpy.app.binary_path, reason="only the real program can be started and killed")
def test_killed_at_any_moment_there_are_only_whole_files(scene, run, tmp_path):
    scene.frame_end = 400
    bpy.ops.wm.save_mainfile()
    command = [bpy.app.binary_path, "--background", str(tmp_path / "scene.blend"), "--command", "meniscus", "render"]
    command += ["--output", str(tmp_path / "####.exr"), "--no-overwrite", "--placeholders", "--passes", "depth"]
    for wait in (0.05, 0.4):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        count = len(names(tmp_path))
        while len(names(tmp_path)) < count + 2 and process.poll() is None:
            time.sleep(0.02)
        time.sleep(wait)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    found = [tmp_path / name for name in names(tmp_path) if not name.startswith(".")]
    claimed = [path for path in found if path.read_bytes().startswith(b"Meniscus renders")]
    whole = [path for path in found if path not in claimed]
    assert 2 <= len(whole) < 400
    assert len(claimed) <= 4
    for path in whole[-3:]:
        assert exr_channels(path)
    last = max(int(path.stem) for path in found)
    assert (
        run("--output", "//####.exr", "--no-overwrite", "--placeholders", "--passes", "depth", "--frames", f"1:{last}")[0] == 0
    )
    assert not names(tmp_path, ".*.tmp.exr")
    assert all((tmp_path / f"{frame:04}.exr").read_bytes()[:4] == b"\x76\x2f\x31\x01" for frame in range(1, last + 1))


def test_a_frame_without_fluid_is_noted(scene, run):
    scene.objects["Fluid"].data.clear_geometry()
    status, _, error = run("--output", "//####.exr", "--frames", "1")
    assert status == 0
    assert "There is no fluid in this frame: if there should be, check the simulation's cache" in error


def test_the_operator_exports_what_the_view_layer_asks_for(scene, tmp_path):
    view_layer = scene.view_layers[0]
    view_layer.use_pass_z = view_layer.meniscus.use_pass_thickness = True
    view_layer.use_pass_cryptomatte_object = True
    scene.frame_set(2)
    assert bpy.ops.meniscus.export_passes(filepath=str(tmp_path / "x_####.exr"), layout="MULTIPART", use_deep=True) == {
        "FINISHED"
    }
    assert names(tmp_path) == [f"x_{kind}000{frame}.exr" for kind in ("", "deep_") for frame in (1, 2, 3)]
    channels = exr_channels(tmp_path / "x_0002.exr")
    assert {name.split(".")[1] for name in channels} == {
        "Combined", "Depth", "Thickness", "CryptoObject00", "CryptoObject01", "CryptoObject02",
    }  # fmt: skip
    assert scene.frame_current == 2


def test_the_operator_says_what_is_wrong(scene, tmp_path):
    with pytest.raises(RuntimeError, match="Unknown token"):
        bpy.ops.meniscus.export_passes(filepath=str(tmp_path / "{x}.exr"))
    scene.camera = None
    with pytest.raises(RuntimeError, match="camera"):
        bpy.ops.meniscus.export_passes(filepath=str(tmp_path / "x.exr"), use_animation=False)
    scene.objects["Fluid"].meniscus.use_fluid = False
    assert not bpy.ops.meniscus.export_passes.poll()


def test_one_frame_keeps_its_name(scene, tmp_path):
    assert bpy.ops.meniscus.export_passes(filepath=str(tmp_path / "still.exr"), use_animation=False) == {"FINISHED"}
    assert names(tmp_path) == ["still.exr"]


@pytest.mark.skipif(not bpy.app.binary_path, reason="only the real program can be started")
def test_the_command_that_flamenco_starts(scene, tmp_path):
    """Its job type (samples/flamenco) chooses the scene behind the file."""
    bpy.ops.scene.new(type="EMPTY")
    bpy.ops.wm.save_mainfile()
    command = [bpy.app.binary_path, "-b", "-y", str(tmp_path / "scene.blend"), "--scene", "Scene", "--command", "meniscus"]
    command += ["render", "--frames=1,3", "--output", str(tmp_path / "out" / "fluid_######.exr"), "--no-overwrite"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert names(tmp_path / "out") == ["fluid_000001.exr", "fluid_000003.exr"]
    assert len(re.findall("^Saved: '(.*)'", result.stdout, re.MULTILINE)) == 2


@pytest.mark.skipif(not bpy.app.binary_path, reason="only the real program can be started")
def test_the_farm_example_splits_a_range_over_processes(scene, meniscus, tmp_path):
    farm = importlib.import_module(f"{meniscus.__name__}.samples.farm")
    scene.frame_end = 4
    bpy.ops.wm.save_mainfile()
    arguments = ["--blender", bpy.app.binary_path, "--workers", "2", "--chunk", "2", str(tmp_path / "scene.blend")]
    assert farm.main([*arguments, "--frames", "1:4", "--", "--output", str(tmp_path / "####.exr")]) == 0
    assert names(tmp_path) == ["0001.exr", "0002.exr", "0003.exr", "0004.exr"]


def test_a_cancelled_export_keeps_what_is_whole(meniscus, scene, tmp_path):
    package = f"{meniscus.__name__}.addon.blender"
    modules = {name: importlib.import_module(f"{package}.{name}") for name in ("export", "render_frames", "render_scene")}
    job = modules["render_frames"].RenderJob(
        scene_uid=scene.session_uid,
        view_layer_name=scene.view_layers[0].name,
        settings=modules["render_scene"].RenderSettings(passes=("depth",)),
        frames=tuple(range(1, 500)),
        output=str(tmp_path / "####.exr"),
        passes=("depth",),
        use_overwrite=False,
        use_placeholders=True,
    )
    scene.frame_set(3)
    run = modules["export"]._Run(job)
    while not run.reports:
        assert run.advance()
    run.cancel()
    run.to_the_end()
    run.close()
    kind, sentence = run.outcome
    assert kind == "WARNING"
    assert sentence.startswith("Cancelled: Meniscus wrote ")
    assert 1 <= len(names(tmp_path)) < 499
    assert all((tmp_path / name).read_bytes()[:4] == b"\x76\x2f\x31\x01" for name in names(tmp_path))
    assert scene.frame_current == 3
