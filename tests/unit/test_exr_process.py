"""The child process that writes EXR files."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from meniscus.addon.fluid.camera import Camera
from meniscus.addon.fluid.errors import OutputError
from meniscus.addon.fluid.image import ImageBuffers, RenderInfo
from meniscus.addon.output import exr_process
from meniscus.addon.output.exr import write_exr
from meniscus.addon.output.exr_content import ExrOptions, flat_content
from meniscus.addon.output.exr_process import ExrProcess
from meniscus.addon.output.whole_file import temporary_path


def random_image(width: int = 31, height: int = 19, seed: int = 0) -> ImageBuffers:
    random = np.random.default_rng(seed)
    passes = {
        "depth": random.random((height, width), np.float32),
        "combined": random.random((height, width, 4), np.float32),
    }
    camera = Camera.perspective((0, -5, 1), (0, 0, 0), width=width, height=height)
    return ImageBuffers(camera, passes, np.ones((height, width), bool), RenderInfo())


def child_id(writer: ExrProcess) -> int:
    return writer._child._process.pid


def test_the_child_writes_the_same_bytes_as_the_process_itself(tmp_path: Path) -> None:
    options = {"view_layer": "Läyer", "compression": "PIZ", "frame": 7, "frames_per_second": 25.0}
    write_exr(tmp_path / "here.exr", random_image(), **options)
    with ExrProcess() as writer:
        milliseconds = writer.write(tmp_path / "there ü.exr", flat_content(random_image(), ExrOptions(**options))).result()
        assert child_id(writer) != os.getpid()
    assert milliseconds > 0
    assert (tmp_path / "there ü.exr").read_bytes() == (tmp_path / "here.exr").read_bytes()


def test_a_small_image_after_a_large_one_leaves_nothing_of_it_in_the_file(tmp_path: Path) -> None:
    write_exr(tmp_path / "here.exr", random_image())
    with ExrProcess() as writer:
        writer.write(tmp_path / "large.exr", flat_content(random_image(64, 48, seed=1))).result()
        writer.write(tmp_path / "there.exr", flat_content(random_image())).result()
    assert (tmp_path / "there.exr").read_bytes() == (tmp_path / "here.exr").read_bytes()


@pytest.mark.skipif(not hasattr(os, "getpriority"), reason="Windows has no niceness")
def test_the_child_yields_to_the_process_that_renders(tmp_path: Path) -> None:
    with ExrProcess() as writer:
        writer.write(tmp_path / "image.exr", flat_content(random_image())).result()
        assert os.getpriority(os.PRIO_PROCESS, child_id(writer)) > os.getpriority(os.PRIO_PROCESS, 0)


def test_the_child_imports_neither_blender_nor_opengl() -> None:
    probe = "; import sys as s; s.exit(len({'bpy', 'moderngl'} & set(s.modules)))"
    code = exr_process._BOOTSTRAP.replace("serve()\n", "pass" + probe)
    folders = exr_process._package_folders("numpy", "OpenEXR")
    command = [sys.executable, "-I", "-c", code, str(exr_process._PACKAGE), *folders]
    assert subprocess.run(command, check=False).returncode == 0


def test_leaving_the_block_waits_for_all_files(tmp_path: Path) -> None:
    with ExrProcess() as writer:
        futures = [writer.write(tmp_path / f"{frame}.exr", flat_content(random_image(seed=frame))) for frame in range(5)]
    assert all(future.done() for future in futures)
    for frame in range(5):
        with OpenEXR.File(str(tmp_path / f"{frame}.exr"), separate_channels=True) as file:
            depth = file.channels()["ViewLayer.Depth.Z"].pixels
            assert np.array_equal(depth, random_image(seed=frame)["depth"][::-1])


def test_a_relative_path_is_relative_to_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ExrProcess() as writer:
        writer.write(tmp_path / "first.exr", flat_content(random_image())).result()
        monkeypatch.chdir(tmp_path)
        writer.write("second.exr", flat_content(random_image())).result()
    assert (tmp_path / "second.exr").exists()


def test_an_error_belongs_to_its_file_alone(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with ExrProcess() as writer:
        bad = writer.write(tmp_path / "file" / "image.exr", flat_content(random_image()))
        good = writer.write(tmp_path / "image.exr", flat_content(random_image()))
    with pytest.raises(OutputError, match="Cannot make the folder"):
        bad.result()
    good.result()
    assert (tmp_path / "image.exr").exists()


def test_a_child_killed_while_it_waits_is_replaced(tmp_path: Path) -> None:
    with ExrProcess() as writer:
        writer.write(tmp_path / "first.exr", flat_content(random_image())).result()
        os.kill(child_id(writer), signal.SIGKILL)
        lost = writer.write(tmp_path / "lost.exr", flat_content(random_image()))
        later = writer.write(tmp_path / "later.exr", flat_content(random_image()))
    with pytest.raises(OutputError, match=r"lost\.exr: the process that writes EXR files ended early"):
        lost.result()
    later.result()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.exr", "later.exr"]


def test_a_killed_child_does_not_take_a_process_with_it_that_heeds_broken_pipes(tmp_path: Path) -> None:
    """Python ignores the signal, some builds of Blender do not."""
    handler = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        with ExrProcess() as writer:
            writer.write(tmp_path / "first.exr", flat_content(random_image())).result()
            os.kill(child_id(writer), signal.SIGKILL)
            writer._child._process.wait()
            with pytest.raises(OutputError, match="ended early"):
                writer.write(tmp_path / "lost.exr", flat_content(random_image())).result()
    finally:
        signal.signal(signal.SIGPIPE, handler)


def test_a_child_killed_in_the_middle_of_a_file_leaves_the_old_one(tmp_path: Path) -> None:
    image = random_image(640, 480)
    target = tmp_path / "image.exr"
    with ExrProcess() as writer:
        writer.write(target, flat_content(image)).result()
        old = target.read_bytes()
        # A named pipe that nobody empties holds the child up in the middle of its writing.
        temporary = temporary_path(target, child_id(writer))
        os.mkfifo(temporary)
        future = writer.write(target, flat_content(random_image(640, 480, seed=1)))
        with temporary.open("rb", buffering=0) as pipe:
            assert pipe.read(100) == old[:100]
            assert not future.done()
            os.kill(child_id(writer), signal.SIGKILL)
            with pytest.raises(OutputError, match="ended early"):
                future.result()
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]
    assert target.read_bytes() == old


def test_a_child_asked_to_terminate_in_the_middle_of_a_file_clears_up(tmp_path: Path) -> None:
    target = tmp_path / "image.exr"
    with ExrProcess() as writer:
        writer.write(target, flat_content(random_image())).result()
        process = writer._child._process
        temporary = temporary_path(target, process.pid)
        os.mkfifo(temporary)
        future = writer.write(target, flat_content(random_image(640, 480)))
        with temporary.open("rb", buffering=0) as pipe:
            pipe.read(100)
            process.terminate()
            assert process.wait() == 1
            assert not temporary.exists()
        with pytest.raises(OutputError, match="status 1"):
            future.result()


def test_ctrl_c_does_not_stop_the_child(tmp_path: Path) -> None:
    with ExrProcess() as writer:
        writer.write(tmp_path / "first.exr", flat_content(random_image())).result()
        os.kill(child_id(writer), signal.SIGINT)
        writer.write(tmp_path / "second.exr", flat_content(random_image())).result()


def test_at_most_two_images_are_under_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, third_was_taken = threading.Event(), threading.Event()

    def blocked_write(*_: object) -> bool:
        go_on.wait()
        return True

    monkeypatch.setattr(exr_process._Child, "write", blocked_write)
    with ExrProcess() as writer:
        for frame in range(2):
            writer.write(tmp_path / f"{frame}.exr", flat_content(random_image()))

        def write_third() -> None:
            writer.write(tmp_path / "2.exr", flat_content(random_image()))
            third_was_taken.set()

        third = threading.Thread(target=write_third)
        third.start()
        was_taken_at_once = third_was_taken.wait(0.3)
        go_on.set()
        third.join()
    assert not was_taken_at_once


def test_the_python_beside_blender_is_used_where_the_program_is_blender(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = tmp_path / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    beside.parent.mkdir()
    beside.symlink_to(sys.executable)
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    for program in ("/opt/blender/blender", ""):
        monkeypatch.setattr(sys, "executable", program)
        assert exr_process._python() == str(beside)


def test_a_missing_python_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/opt/blender/blender")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    with ExrProcess() as writer:
        future = writer.write(tmp_path / "image.exr", flat_content(random_image()))
    with pytest.raises(OutputError, match="No Python program was found"):
        future.result()


def test_a_missing_openexr_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "OpenEXR.py").write_text("raise ImportError('no such library')")
    monkeypatch.setattr(exr_process, "_BOOTSTRAP", "import sys; sys.path.insert(0, sys.argv[2])\n" + exr_process._BOOTSTRAP)
    monkeypatch.setattr(exr_process, "_package_folders", lambda *_: [str(tmp_path)])
    with ExrProcess() as writer:
        future = writer.write(tmp_path / "image.exr", flat_content(random_image()))
    with pytest.raises(OutputError, match=r"The OpenEXR package cannot be loaded \(no such library\)"):
        future.result()
