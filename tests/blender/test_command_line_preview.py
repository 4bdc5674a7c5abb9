"""Preview pictures."""

import importlib
import resource
import signal
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest


def preview_module(meniscus: ModuleType) -> ModuleType:
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.preview")


def srgb(linear: np.ndarray) -> np.ndarray:
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def read_png(path: Path, width: int, height: int) -> np.ndarray:
    assert path.read_bytes().startswith(b"\x89PNG")
    picture = bpy.data.images.load(str(path))
    assert tuple(picture.size) == (width, height)
    return np.array(picture.pixels, np.float32).reshape(height, width, 4)


def test_colours_are_shown_over_the_background_in_srgb(
    meniscus: ModuleType, empty_scene: bpy.types.Scene, tmp_path: Path
) -> None:
    preview = preview_module(meniscus)
    random = np.random.default_rng(0)
    rgba = random.uniform(0, 1.2, (13, 21, 4)).astype(np.float32)
    rgba[..., 3] = random.uniform(0, 1, (13, 21))
    rgba[..., :3] *= rgba[..., 3:]
    rgba[0, 0] = 0
    preview.write_png(tmp_path / "a" / "preview.png", rgba)
    pixels = read_png(tmp_path / "a" / "preview.png", 21, 13)
    expected = srgb(rgba[..., :3] + (1 - rgba[..., 3:]) * preview.BACKGROUND)
    assert np.abs(pixels[..., :3] - expected).max() < 0.51 / 255
    assert np.all(pixels[..., 3] == 1)
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["preview.png"]


def test_no_picture_stays_in_the_blend_file(meniscus: ModuleType, empty_scene: bpy.types.Scene, tmp_path: Path) -> None:
    before = len(bpy.data.images)
    preview_module(meniscus).write_png(tmp_path / "preview.png", np.zeros((4, 4, 4), np.float32))
    assert len(bpy.data.images) == before


def test_a_full_disk_leaves_the_old_picture(meniscus: ModuleType, empty_scene: bpy.types.Scene, tmp_path: Path) -> None:
    errors = importlib.import_module(f"{meniscus.__name__}.addon.fluid.errors")
    (tmp_path / "preview.png").write_bytes(b"old")
    noise = np.random.default_rng(0).random((64, 64, 4), np.float32)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # Not all builds of Blender do so themselves.
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A limit on the size of files makes the system refuse the write in the middle, as a full disk does.
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(errors.OutputError, match=r"Cannot write .*preview\.png: the disk is full"):
            preview_module(meniscus).write_png(tmp_path / "preview.png", noise)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path.name for path in tmp_path.iterdir()] == ["preview.png"]
    assert (tmp_path / "preview.png").read_bytes() == b"old"
