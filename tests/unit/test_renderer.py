"""The renderer: passes, regions, choices, errors. On the CPU, so that it runs anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.camera import Region
from meniscus.addon.fluid.errors import CancelledError, DeviceError, InputError
from meniscus.addon.render import registry, renderer

BALLS = meniscus.Balls([[-0.3, 0, 0], [0.4, 0.2, 0.1]], 0.9)
CAMERA = meniscus.Camera.perspective((0.5, -4, 1), (0, 0, 0), fov_y=0.6, width=48, height=36)
ALL_PASSES = ("combined", "depth", "normal", "position")


def render(camera=CAMERA, balls=BALLS, **options):
    return meniscus.render(balls, camera, meniscus.Field(), **{"backend": "cpu", "passes": ALL_PASSES, **options})


def test_images_have_their_shapes_types_and_backgrounds():
    image = render()
    assert {name: image[name].shape for name in ALL_PASSES} == {
        "combined": (36, 48, 4),
        "depth": (36, 48),
        "normal": (36, 48, 3),
        "position": (36, 48, 3),
    }
    assert all(image[name].dtype == np.float32 for name in ALL_PASSES)
    assert 0.05 < image.hit.mean() < 0.9
    assert np.all(image["depth"][~image.hit] == np.float32(1e10))
    assert not any(image[name][~image.hit].any() for name in ("combined", "normal", "position"))
    assert np.all(image["combined"][image.hit][:, 3] == 1)


def test_row_zero_is_at_the_bottom():
    low = meniscus.Balls([[0, 0, -0.6]], 0.5)
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2, width=8, height=8)
    hit = render(camera, low).hit
    assert hit[:4].any()
    assert not hit[4:].any()


def test_position_lies_on_the_ray_at_the_depth():
    image = render()
    world = np.concatenate([image["position"][image.hit], np.ones((image.hit.sum(), 1))], axis=1)
    in_view = world @ CAMERA.view_from_world.T
    np.testing.assert_allclose(-in_view[:, 2], image["depth"][image.hit], atol=1e-5)
    clip = in_view @ CAMERA.clip_from_view.T
    pixels = (clip[:, :2] / clip[:, 3:] + 1) / 2 * (48, 36) - 0.5
    rows, columns = np.nonzero(image.hit)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], 1), atol=1e-3)


def test_headlight_is_brightest_where_the_surface_faces_the_eye():
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2, width=21, height=21)
    look = meniscus.Look(style="headlight", color=(0.5, 0.25, 1.0), ambient=0.2)
    row = render(camera, meniscus.Balls([[0, 0, 0]], 0.9), look=look)["combined"][10]
    np.testing.assert_allclose(row[10, :3], (0.5, 0.25, 1.0), atol=1e-4)
    lit = row[row[:, 3] > 0][:, 0]
    assert np.all(np.diff(lit[: len(lit) // 2 + 1]) > 0)
    assert lit[0] > 0.2 * 0.5


def test_region_is_the_same_part_of_the_whole_image():
    region = Region(10, 6, 30, 25)
    whole, part = render(), render(replace(CAMERA, region=region))
    inside = np.zeros_like(whole.hit)
    inside[6:25, 10:30] = True
    np.testing.assert_array_equal(part.hit, whole.hit & inside)
    np.testing.assert_allclose(part["depth"][inside], whole["depth"][inside], rtol=1e-6)
    assert np.all(part["depth"][~inside] == np.float32(1e10))


def test_info_says_what_happened():
    balls = meniscus.Balls([[0, 0, 0], [np.nan, 0, 0], [500, 0, 0]], 0.5)
    info = render(balls=balls).info
    assert (info.method, info.backend) == ("tile_caster", "cpu")
    assert "CPU" in info.device
    assert info.counts["balls"] == 2
    assert info.counts["balls_drawn"] == 1
    assert info.dropped == {"position is not finite": 1}
    assert list(info.milliseconds) == ["build", "cast", "passes"]


def test_cancelling_stops_the_render():
    with pytest.raises(CancelledError):
        render(is_cancelled=lambda: True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"method": "marching_cubes"},
            "Unknown method 'marching_cubes': choose auto, tile_lists, tile_caster, fitted_bvh, depth_peeling",
        ),
        ({"backend": "tpu"}, "Unknown back-end 'tpu'"),
        ({"method": "depth_peeling", "backend": "cpu"}, "runs on the back-end 'gpu', not on 'cpu'"),
        ({"passes": ("dpeth",)}, "Unknown pass 'dpeth'"),
    ],
)
def test_unknown_choices_are_named(options, message):
    with pytest.raises(InputError, match=message):
        render(**options)


@pytest.fixture
def no_opengl(monkeypatch):
    def fail():
        raise DeviceError("OpenGL 3.3 is not available here")

    # Loaded before, or they would keep the function that fails.
    names = ("tile_lists", "fitted_bvh", "depth_peeling")
    modules = [registry._import(f"gpu_shaders.methods.{name}", "method") for name in names]
    monkeypatch.setattr(registry.gpu(), "shared_context", fail)
    for module in modules:
        monkeypatch.setattr(module, "create", fail)


def test_the_fastest_method_is_taken_and_says_why(monkeypatch):
    opengl = registry.gpu().shared_context()
    monkeypatch.setattr(opengl, "renderer", "A fast graphics processor")
    assert render(backend="auto").info.method == "tile_lists"
    monkeypatch.setattr(opengl, "renderer", "llvmpipe")
    assert render(backend="auto").info.method == "tile_caster"
    assert "fastest" in render(backend="auto").info.reason
    assert render(backend="auto", method="tile_caster").info.reason == "Chosen in the settings"


def test_where_the_fastest_method_cannot_run_the_next_one_does_and_says_why(monkeypatch):
    create = renderer.create_method
    native = {info.name for info in registry.method_infos() if info.backend == "cpu"}

    def fail(name):
        if name in native:
            raise DeviceError("The native module is missing")
        return create(name)

    monkeypatch.setattr(renderer, "create_method", fail)
    info = render(backend="auto", passes=("depth", "normal")).info
    assert (info.method, info.reason) == ("tile_lists", "The native module is missing")


def test_without_opengl_the_cpu_does_the_work(no_opengl):
    assert render(backend="auto").info.backend == "cpu"


def test_without_opengl_the_gpu_says_why_not(no_opengl):
    with pytest.raises(DeviceError, match="not available here"):
        render(backend="gpu")
    problems = {status.name: status.problem for status in meniscus.methods()}
    assert "not available" in problems["tile_lists"]
    assert "not available" in problems["fitted_bvh"]
    assert "not available" in problems["depth_peeling"]
    assert not problems["tile_caster"]


def test_unknown_pass_of_an_image_is_named():
    with pytest.raises(InputError, match="no pass 'normal', only depth"):
        render(passes=("depth",))["normal"]


def test_image_does_not_depend_on_threads():
    whole = render(threads=1)
    for threads in (0, 3):
        other = render(threads=threads)
        for name in ALL_PASSES:
            np.testing.assert_array_equal(other[name], whole[name])
        assert other.info.counts == whole.info.counts


def test_progressive_images_become_finer_and_end_with_the_whole_one():
    whole = render()
    coarse, middle, fine = meniscus.render_progressively(BALLS, CAMERA, meniscus.Field(), backend="cpu", passes=ALL_PASSES)
    for name in ALL_PASSES:
        np.testing.assert_array_equal(fine[name], whole[name])
    differences = [np.count_nonzero(image["depth"] != whole["depth"]) for image in (coarse, middle, fine)]
    assert differences[0] > differences[1] > differences[2] == 0
    # A block of four by four shows its middle pixel.
    np.testing.assert_allclose(coarse["depth"][2::4, 2::4], whole["depth"][2::4, 2::4], rtol=1e-6)
    assert np.all(coarse["depth"].reshape(9, 4, 12, 4) == coarse["depth"][::4, ::4][:, None, :, None])


def test_velocity_and_ball_are_those_of_the_nearest():
    balls = meniscus.Balls([[-1, 0, 0], [1, 0, 0]], 0.8, velocities=[[1, 2, 3], [4, 5, 6]], ids=[70, 90])
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=3, width=3, height=3)
    image = render(camera, balls, passes=("velocity", "ball_id"))
    np.testing.assert_allclose(image["velocity"][1], [[1, 2, 3], [0, 0, 0], [4, 5, 6]], rtol=1e-6)
    assert image["ball_id"][1].tolist() == [70, -1, 90]
    unnamed = meniscus.Balls(balls.positions, balls.radii)
    image = render(camera, unnamed, passes=("velocity", "ball_id"))
    assert not image["velocity"].any()
    assert image["ball_id"][1].tolist() == [0, -1, 1]


def test_a_method_says_which_pass_it_cannot_make():
    with pytest.raises(InputError, match="'depth_peeling' cannot make the pass velocity"):
        render(backend="auto", method="depth_peeling", passes=("velocity",))


def test_progress_rises_to_the_end():
    random = np.random.default_rng(1)
    balls = meniscus.Balls(random.random((300_000, 3)), 0.02)
    shares = []
    render(CAMERA, balls, on_progress=shares.append)
    assert all(0 <= share <= 1 for share in shares)


def test_a_negative_number_of_threads_is_refused():
    with pytest.raises(InputError, match="number of threads"):
        render(threads=-1)


def test_a_missing_package_of_opengl_is_one_sentence(monkeypatch):
    find = registry.importlib.import_module

    def import_module(name):
        if name.endswith(("gpu_shaders.context", "depth_peeling.method")):
            raise ImportError("No module named 'moderngl'")
        return find(name)

    monkeypatch.setattr(registry.importlib, "import_module", import_module)
    with pytest.raises(DeviceError, match=r"a package is missing \(No module named 'moderngl'\); reinstall the extension"):
        render(backend="auto", method="depth_peeling")
    for status in meniscus.methods():
        assert bool(status.problem) == (status.backend == "gpu"), status.name
