"""What write_exr puts into a file, read back through OpenEXR."""

import errno
import resource
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from meniscus.addon.fluid.camera import Camera, Region, Window
from meniscus.addon.fluid.cryptomatte import Coverage
from meniscus.addon.fluid.errors import InputError, OutputError
from meniscus.addon.fluid.image import ImageBuffers, RenderInfo
from meniscus.addon.output.exr import write_exr
from meniscus.addon.output.exr_content import COMPRESSIONS
from meniscus.addon.output.whole_file import whole_file

WIDTH, HEIGHT = 23, 17

# Off centre and with pixels that are not square, so that a swapped sign or axis shows.
PERSPECTIVE = replace(
    Camera.perspective((3.0, -5.0, 2.0), (0.2, 0.1, 0.3), up=(0.1, 0.2, 1.0), width=WIDTH, height=HEIGHT),
    window=Window(-0.3, 0.7, -0.2, 0.4),
    pixel_aspect=1.5,
)
ORTHOGRAPHIC = replace(
    Camera.orthographic((3.0, -5.0, 2.0), (0.2, 0.1, 0.3), width=WIDTH, height=HEIGHT), window=Window(-1.0, 4.0, -3.0, 2.0)
)


def random_image(camera: Camera = PERSPECTIVE, seed: int = 0) -> ImageBuffers:
    random = np.random.default_rng(seed)
    shape = (camera.height, camera.width)
    passes = {
        "depth": random.uniform(0.1, 1000, shape).astype(np.float32),
        "normal": random.uniform(-1, 1, (*shape, 3)).astype(np.float32),
        "position": random.normal(0, 1e4, (*shape, 3)).astype(np.float32),
        "combined": random.uniform(0, 2, (*shape, 4)).astype(np.float32),
    }
    passes["depth"][3:5, 6:9] = 1e10
    return ImageBuffers(camera, passes, passes["depth"] < 1e10, RenderInfo())


def read_exr(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """Header and channels, row 0 at the top as in the file."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return dict(file.header()), {name: channel.pixels.copy() for name, channel in file.channels().items()}


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_data_passes_come_back_bit_for_bit_under_blenders_names(tmp_path: Path, compression: str) -> None:
    image = random_image()
    write_exr(tmp_path / "image.exr", image, compression=compression)
    header, channels = read_exr(tmp_path / "image.exr")
    written = "NO" if compression == "NONE" else compression
    assert header["compression"] == getattr(OpenEXR, f"{written}_COMPRESSION")
    expected = {"ViewLayer.Depth.Z": image["depth"]}
    for axis, letter in enumerate("XYZ"):
        expected[f"ViewLayer.Normal.{letter}"] = image["normal"][..., axis]
        expected[f"ViewLayer.Position.{letter}"] = image["position"][..., axis]
    assert set(channels) == set(expected) | {f"ViewLayer.Combined.{letter}" for letter in "RGBA"}
    for name, values in expected.items():
        assert channels[name].dtype == np.float32, name
        assert np.array_equal(channels[name], values[::-1]), name


def test_colour_is_rounded_to_half_floats_and_clamped_to_their_range(tmp_path: Path) -> None:
    image = random_image()
    image["combined"][0, 0] = (1e6, -1e6, np.inf, 1.0)
    write_exr(tmp_path / "image.exr", image)
    _, channels = read_exr(tmp_path / "image.exr")
    red = channels["ViewLayer.Combined.R"]
    assert red.dtype == np.float16
    assert [channels[f"ViewLayer.Combined.{letter}"][-1, 0] for letter in "RGBA"] == [65504, -65504, 65504, 1]
    assert np.array_equal(red[:-1], image["combined"][1:, :, 0][::-1].astype(np.float16))


def test_data_that_is_not_finite_is_kept(tmp_path: Path) -> None:
    image = random_image()
    image["position"][2, 3] = (np.inf, -np.inf, np.nan)
    write_exr(tmp_path / "image.exr", image)
    _, channels = read_exr(tmp_path / "image.exr")
    stored = [channels[f"ViewLayer.Position.{letter}"][HEIGHT - 1 - 2, 3] for letter in "XYZ"]
    assert stored[:2] == [np.inf, -np.inf]
    assert np.isnan(stored[2])


def test_the_header_tells_size_pixel_aspect_frame_rate_and_software(tmp_path: Path) -> None:
    write_exr(tmp_path / "image.exr", random_image(), frame=-12, frames_per_second=25.0)
    header, _ = read_exr(tmp_path / "image.exr")
    for window in ("displayWindow", "dataWindow"):
        assert [corner.tolist() for corner in header[window]] == [[0, 0], [WIDTH - 1, HEIGHT - 1]]
    assert header["pixelAspectRatio"] == 1.5
    assert (header["imageCounter"], header["Frame"]) == (-12, "-12")
    assert header["framesPerSecond"] == Fraction(25)
    assert header["software"].startswith("Meniscus ")


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        (24 / float(np.float32(1.001)), Fraction(24000, 1001)),  # Blender holds 1.001 as a 32-bit float.
        (29.97, Fraction(30000, 1001)),
        (60, Fraction(60)),
        (12.5, Fraction(25, 2)),
    ],
)
def test_frame_rates_are_exact_fractions(tmp_path: Path, rate: float, expected: Fraction) -> None:
    write_exr(tmp_path / "image.exr", random_image(), frames_per_second=rate)
    header, _ = read_exr(tmp_path / "image.exr")
    assert header["framesPerSecond"] == expected


def test_the_header_leaves_out_what_is_unknown(tmp_path: Path) -> None:
    write_exr(tmp_path / "image.exr", random_image())
    header, _ = read_exr(tmp_path / "image.exr")
    assert not {"imageCounter", "Frame", "framesPerSecond"} & set(header)


def world_points_on_pixels(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(height, width, 4) homogeneous world points at the pixel centres, row 0 at the bottom."""
    origins, directions = camera.view_rays()
    in_view = np.ones((*depth.shape, 4))
    in_view[..., :3] = origins + depth[..., None] * directions
    return in_view @ camera.world_from_view.T


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_world_to_ndc_puts_each_point_on_its_pixel(tmp_path: Path, camera: Camera) -> None:
    write_exr(tmp_path / "image.exr", random_image(camera))
    header, _ = read_exr(tmp_path / "image.exr")
    depth = np.random.default_rng(1).uniform(1, 50, (HEIGHT, WIDTH))
    projected = world_points_on_pixels(camera, depth) @ header["worldToNDC"].astype(np.float64)
    ndc = projected[..., :3] / projected[..., 3:]
    column, row_from_bottom = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    assert ndc[..., 0] * WIDTH - 0.5 == pytest.approx(column, abs=1e-3)
    assert ndc[..., 1] * HEIGHT - 0.5 == pytest.approx(HEIGHT - 1 - row_from_bottom, abs=1e-3)


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_world_to_ndc_runs_from_0_at_the_clip_start_to_1_at_the_clip_end(tmp_path: Path, camera: Camera) -> None:
    write_exr(tmp_path / "image.exr", random_image(camera))
    header, _ = read_exr(tmp_path / "image.exr")
    for depth, expected in ((camera.clip_start, 0.0), (camera.clip_end, 1.0)):
        points = world_points_on_pixels(camera, np.full((HEIGHT, WIDTH), depth))
        projected = points @ header["worldToNDC"].astype(np.float64)
        assert projected[..., 2] / projected[..., 3] == pytest.approx(expected, abs=1e-4)


def test_world_to_camera_is_left_handed_and_looks_along_positive_z(tmp_path: Path) -> None:
    write_exr(tmp_path / "image.exr", random_image())
    header, _ = read_exr(tmp_path / "image.exr")
    matrix = header["worldToCamera"].astype(np.float64)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(-1, abs=1e-5)
    right, up, backward = PERSPECTIVE.world_from_view[:3, :3].T
    point = PERSPECTIVE.eye + 2 * right + 3 * up - 5 * backward
    assert np.append(point, 1) @ matrix == pytest.approx([2, 3, 5, 1], abs=1e-5)


def test_a_region_lies_in_the_whole_image(tmp_path: Path) -> None:
    image = random_image(replace(PERSPECTIVE, region=Region(4, 2, 9, 8)))
    write_exr(tmp_path / "image.exr", image)
    header, channels = read_exr(tmp_path / "image.exr")
    assert header["dataWindow"][1].tolist() == [WIDTH - 1, HEIGHT - 1]
    assert np.array_equal(channels["ViewLayer.Depth.Z"], image["depth"][::-1])


def test_the_view_layer_names_the_channels(tmp_path: Path) -> None:
    image = random_image()
    write_exr(tmp_path / "image.exr", replace(image, passes={"depth": image["depth"]}), view_layer="Spray.001 é")
    assert set(read_exr(tmp_path / "image.exr")[1]) == {"Spray.001 é.Depth.Z"}


def test_missing_folders_are_made(tmp_path: Path) -> None:
    write_exr(tmp_path / "a" / "b" / "image.exr", random_image())
    assert OpenEXR.isOpenExrFile(str(tmp_path / "a" / "b" / "image.exr"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"compression": "DWAA"}, "Unknown compression 'DWAA': choose from ZIP, ZIPS, PIZ, RLE, NONE"),
        ({"view_layer": ""}, "The view layer needs a name"),
    ],
)
def test_unusable_options_are_refused(tmp_path: Path, options: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        write_exr(tmp_path / "image.exr", random_image(), **options)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_files_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "image.exr").mkdir()
    with pytest.raises(OutputError, match="it is a folder"):
        write_exr(tmp_path / "image.exr", random_image())


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(OutputError, match=r"Cannot make the folder .*file.below: not a directory; choose another folder"):
        write_exr(tmp_path / "file" / "below" / "image.exr", random_image())


def test_a_folder_below_which_nothing_can_be_written_is_named() -> None:
    with pytest.raises(OutputError, match=r"Cannot write|Cannot make"):
        write_exr("/proc/self/image.exr", random_image())


def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    write_exr(tmp_path / "image.exr", random_image())
    old = (tmp_path / "image.exr").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    # A limit on the size of files makes the system refuse the write in the middle, as a full disk does.
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(OutputError, match=r"image\.exr: the disk is full; free some space"):
            write_exr(tmp_path / "image.exr", random_image(seed=1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]
    assert (tmp_path / "image.exr").read_bytes() == old


def test_a_disk_that_turns_out_full_when_flushed_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr(tmp_path / "image.exr", random_image())
    old = (tmp_path / "image.exr").read_bytes()

    def full_disk(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OutputError, match="the disk is full"):
        write_exr(tmp_path / "image.exr", random_image(seed=1))
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]
    assert (tmp_path / "image.exr").read_bytes() == old


def test_nothing_of_the_file_shows_before_it_is_whole(tmp_path: Path) -> None:
    with whole_file(tmp_path / "image.exr") as temporary:
        temporary.write_bytes(b"half")
        assert temporary.parent == tmp_path
        assert not (tmp_path / "image.exr").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]


def interrupted_write(path: Path) -> None:
    with whole_file(path) as temporary:
        temporary.write_bytes(b"half")
        raise KeyboardInterrupt


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "image.exr").write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        interrupted_write(tmp_path / "image.exr")
    assert [path.name for path in tmp_path.iterdir()] == ["image.exr"]
    assert (tmp_path / "image.exr").read_bytes() == b"old"


def test_multipart_files_have_a_part_for_each_pass(tmp_path: Path) -> None:
    image = random_image()
    write_exr(tmp_path / "one.exr", image)
    write_exr(tmp_path / "many.exr", image, is_multipart=True, frame=3)
    with OpenEXR.File(str(tmp_path / "many.exr"), separate_channels=True) as file:
        assert [part.name() for part in file.parts] == [
            f"ViewLayer.{name}" for name in ("Depth", "Normal", "Position", "Combined")
        ]
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
        assert all(part.header["imageCounter"] == 3 and "worldToCamera" in part.header for part in file.parts)
    single = read_exr(tmp_path / "one.exr")[1]
    assert channels.keys() == single.keys()
    for name, pixels in single.items():
        np.testing.assert_array_equal(channels[name], pixels)


@pytest.mark.parametrize("is_multipart", [False, True])
def test_mattes_and_their_manifest_are_written(tmp_path: Path, is_multipart: bool) -> None:
    image, coverage = random_image(), Coverage(2)
    coverage.add(np.zeros((HEIGHT, WIDTH), np.int32), ("Cube",))
    mattes = replace(image, cryptomatte=coverage.cryptomatte((HEIGHT, WIDTH)))
    write_exr(tmp_path / "image.exr", mattes, is_multipart=is_multipart)
    with OpenEXR.File(str(tmp_path / "image.exr"), separate_channels=True) as file:
        header = dict(file.header())
        channels = {name: channel.pixels.copy() for part in file.parts for name, channel in part.channels.items()}
    assert header["cryptomatte/542cafa/manifest"] == '{"Cube": "a8fce865"}'
    assert channels["ViewLayer.CryptoObject00.r"].view(np.uint32)[0, 0] == 0xA8FCE865
    assert channels["ViewLayer.CryptoObject00.g"].min() == 1


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC])
def test_the_matrices_project_known_points(tmp_path: Path, camera: Camera) -> None:
    """A point that a pixel shows comes out at that pixel, and at its depth, for a reader who knows only the standard."""
    origins, directions = camera.view_rays()
    depth = 4.2
    in_view = origins + depth * directions
    world = in_view @ camera.world_from_view[:3, :3].T + camera.eye
    write_exr(tmp_path / "image.exr", random_image(camera))
    header, _ = read_exr(tmp_path / "image.exr")
    row, column = 4, 9
    point = np.append(world[row, column], 1.0)
    in_camera = point @ np.array(header["worldToCamera"], np.float64).reshape(4, 4)
    assert in_camera[2] == pytest.approx(depth, rel=1e-5)
    projected = point @ np.array(header["worldToNDC"], np.float64).reshape(4, 4)
    x, y = projected[:2] / projected[3]
    assert (x * WIDTH, (1 - y) * HEIGHT) == pytest.approx((column + 0.5, row + 0.5), abs=1e-3)
