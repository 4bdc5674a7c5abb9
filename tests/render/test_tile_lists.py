"""What Tile Lists does beside what every method must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bench.scenes import SCENES as BENCH_SCENES
from judge import judge
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.errors import DeviceError
from meniscus.gpu_shaders.context import GpuContext
from meniscus.gpu_shaders.methods.tile_lists import memory, method, programs

EXACT = ("random_5000", "lattice_with_droplets", "eye_inside_fluid", "crowded_corner", "negative_weights", "kernel_power_1")


@pytest.fixture
def use(monkeypatch, opengl):
    """Has the registry give a method that was made with certain arguments."""

    def use(**arguments):
        made = method.TileLists(opengl, **arguments)
        monkeypatch.setattr(method, "create", lambda: made)

    return use


def image_of(scene, camera, passes=("depth", "normal"), balls=None):
    return meniscus.render(balls or scene.balls, camera, scene.field, method="tile_lists", passes=passes)


def assert_equal(image, other):
    for name in image.passes:
        np.testing.assert_array_equal(image[name], other[name])


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("length", [1, 2])
def test_rays_in_more_balls_than_they_can_list_find_the_same(use, name, length):
    use(list_length=length)
    scene = SCENES[name]()
    camera = scene.camera("perspective")
    image = image_of(scene, camera)
    assert image.info.counts["crowded_rays"] > 20
    judge(image, scene, camera)


def inside_carved_fluid():
    """Seen from within a dense fluid, of which some balls carve."""
    scene = SCENES["random_5000"]()
    weights = np.where(np.arange(5000) % 7 == 0, -0.4, 0.5)
    return replace(scene, balls=meniscus.Balls(scene.balls.positions, scene.balls.radii, weights), eye=(0.02, -0.1, 0.03))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize(
    "make", [SCENES["random_5000"], SCENES["lattice_with_droplets"], SCENES["radii_over_six_orders"], inside_carved_fluid]
)
def test_balls_that_do_not_fit_are_searched_slab_by_slab(use, make, projection):
    scene = make()
    camera = scene.camera(projection)
    use(most_balls=len(scene.balls) // 2)
    judge(image_of(scene, camera), scene, camera)


def test_a_slab_of_equal_weights_among_others(use):
    """Weights that differ only from the near to the far half."""
    scene = SCENES["random_5000"]()
    weights = np.where(scene.balls.positions[:, 1] < 0, 0.4, 1.0)
    scene = replace(scene, balls=meniscus.Balls(scene.balls.positions, scene.balls.radii, weights))
    camera = scene.camera("orthographic")
    use(most_balls=2000)
    judge(image_of(scene, camera), scene, camera)


def test_lists_that_do_not_fit_make_slabs_thinner(pretend_limits, use):
    scene = SCENES["random_5000"]()
    use()
    pretend_limits(storage_block_bytes=32 * 4000)
    camera = scene.camera("perspective")
    image = image_of(scene, camera)
    assert image.info.counts["entries"] > 32 * 4000 / 8
    judge(image, scene, camera)


def test_too_many_balls_in_one_place_are_told_with_both_numbers(use):
    use(most_balls=1000)
    balls = meniscus.Balls(np.zeros((4000, 3)), 1.0, weights=0.001)
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=16, height=12)
    with pytest.raises(DeviceError, match=r"4,000 balls overlap at one distance but .* takes at most 1,000 at once"):
        meniscus.render(balls, camera, meniscus.Field(), method="tile_lists")


def test_slabs_keep_what_balls_carry(use):
    random = np.random.default_rng(3)
    positions = random.random((3000, 3)) * 2 - 1
    balls = meniscus.Balls(positions, 0.12, colors=random.random((3000, 3)), velocities=positions, ids=np.arange(3000)[::-1])
    scene = Scene(balls)
    passes = ("depth", "color", "velocity", "ball_id")
    whole = image_of(scene, scene.camera("perspective"), passes)
    use(most_balls=1000)
    in_slabs = image_of(scene, scene.camera("perspective"), passes)
    for name in passes:
        np.testing.assert_allclose(in_slabs[name], whole[name], atol=2e-5)


def test_what_the_balls_carry_is_that_of_the_cpu():
    random = np.random.default_rng(4)
    positions = random.random((500, 3)) * 2 - 1
    weights = random.random(500) + 0.5
    balls = meniscus.Balls(positions, 0.3, weights, random.random((500, 3)), 10 * positions, np.arange(500)[::-1] + 7)
    camera = Scene(balls).camera("perspective")
    passes = ("depth", "color", "velocity", "ball_id")
    found, wanted = (
        meniscus.render(balls, camera, meniscus.Field(), method=name, passes=passes) for name in ("tile_lists", "tile_caster")
    )
    same = found.hit & wanted.hit & (np.abs(found["depth"] - wanted["depth"]) < 1e-4)
    assert same.sum() > 0.999 * wanted.hit.sum()
    np.testing.assert_allclose(found["color"][same], wanted["color"][same], atol=1e-3)
    np.testing.assert_allclose(found["velocity"][same], wanted["velocity"][same], atol=1e-2)
    assert np.mean(found["ball_id"][same] == wanted["ball_id"][same]) > 0.998


@pytest.mark.parametrize("name", ["random_10k", "random_100k", "dense_120k", "argon", "block_10k"])
def test_pictures_of_the_samples_are_those_of_the_cpu(name):
    scene = BENCH_SCENES[name]
    balls = scene.make_balls()
    camera = scene.camera(balls, 320, 240)
    found, wanted = (
        meniscus.render(balls, camera, scene.field, method=method, passes=("combined",))["combined"]
        for method in ("tile_lists", "tile_caster")
    )
    assert np.mean(wanted[..., 3] > 0) > 0.1
    assert np.mean(np.abs(found - wanted).max(axis=2) > 2 / 255) <= 0.0005


def test_buffers_grow_until_everything_fits(monkeypatch, use):
    scene = SCENES["random_5000"]()
    camera = scene.camera("perspective")
    whole = image_of(scene, camera)
    monkeypatch.setattr(memory, "_LEAST_SEEN", 7)
    monkeypatch.setattr(memory, "_LEAST_ENTRIES", 5)
    use()
    assert_equal(image_of(scene, camera), whole)


def test_after_an_error_the_next_image_is_right(monkeypatch, opengl, use):
    """As where the driver has no memory: it notes that, and what was made is of no use."""
    scene = SCENES["random_5000"]()
    camera = scene.camera("perspective")
    whole = image_of(scene, camera)
    use()
    driver_errors = opengl._driver.errors
    monkeypatch.setattr(opengl._driver, "errors", lambda: ["GL_OUT_OF_MEMORY"])
    with pytest.raises(DeviceError, match="GL_OUT_OF_MEMORY"):
        image_of(scene, camera)
    monkeypatch.setattr(opengl._driver, "errors", driver_errors)
    made = method.create()
    assert made._balls is None
    assert_equal(image_of(scene, camera), whole)


def test_lists_of_any_length_are_sorted_alike(monkeypatch, use):
    """Lists of a few, some hundred and some thousand entries, sorted by single threads and by groups of several sizes."""
    random = np.random.default_rng(5)
    column = random.random((13000, 3)) * (0.01, 4, 0.01) + (0.4, -2, 0)
    spread = random.random((2000, 3)) * 2 - 1
    weights = np.repeat([0.0009, 0.3], [13000, 2000])
    scene = Scene(meniscus.Balls(np.concatenate([column, spread]), np.repeat([0.2, 0.15], [13000, 2000]), weights))
    camera = scene.camera("perspective")
    images = []
    for is_software in (True, False):
        monkeypatch.setattr(GpuContext, "is_software", is_software)
        use()
        images.append(image_of(scene, camera))
    # More than twice what a group has room for.
    assert images[0].info.counts["longest_list"] > 2 << programs.LONGEST_STAGES
    assert_equal(*images)


def test_every_run_gives_the_same_image(use):
    scene = SCENES["lattice_with_droplets"]()
    images = []
    for _ in range(3):
        use()
        images.append(image_of(scene, scene.camera("perspective")))
    for image in images[1:]:
        assert_equal(image, images[0])


def flight(scene, frames):
    """Cameras that come nearer and turn, and at last jump."""
    for frame in range(frames):
        angle = 0.03 * frame + (1.5 if frame == frames - 1 else 0.0)
        eye = (2.5 - 0.1 * frame) * np.array([np.sin(angle), -np.cos(angle), 0.2])
        yield meniscus.Camera.perspective(eye, (0, 0, 0), fov_y=0.9, width=96, height=72)


@pytest.mark.parametrize("moves", [False, True])
def test_what_was_seen_before_changes_no_image(use, moves):
    """Frame by frame with what is known from the one before, and without."""
    scene = SCENES["lattice_with_droplets"]()
    use()
    known = method.create()
    for frame, camera in enumerate(flight(scene, 8)):
        positions = scene.balls.positions + np.float32(0.01 * frame * moves)
        balls = meniscus.Balls(positions, scene.balls.radii)
        use()
        fresh = image_of(scene, camera, balls=balls)
        method.create = lambda: known
        assert_equal(image_of(scene, camera, balls=balls), fresh)
    assert next(iter(known._memory.values())).known_among(len(scene.balls)) > 0


@pytest.mark.parametrize("radii", [1e-20, 1e20, [1e20, 0.5, 1e-20], [0.5, 1e-20, 0.5]])
def test_radii_beyond_all_reason(radii):
    balls = meniscus.Balls([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], radii)
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=32, height=24)
    found = meniscus.render(balls, camera, meniscus.Field(), method="tile_lists")
    again = meniscus.render(SCENES["one_ball"]().balls, camera, meniscus.Field(), method="tile_lists")
    assert again.hit.any()
    wanted = meniscus.render(balls, camera, meniscus.Field(), method="tile_caster")
    np.testing.assert_array_equal(found.hit, wanted.hit)


def test_a_million_balls_in_one_pixel():
    positions = np.random.default_rng(6).random((1_000_000, 3)) * (1e-3, 1, 1e-3)
    balls = meniscus.Balls(positions, 1e-3, weights=0.001)
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=3, width=32, height=24)
    image = meniscus.render(balls, camera, meniscus.Field(), method="tile_lists")
    wanted = meniscus.render(balls, camera, meniscus.Field(), method="tile_caster")
    np.testing.assert_array_equal(image.hit, wanted.hit)


def test_no_balls_and_no_seen_balls(opengl):
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=32, height=24)
    for positions in (np.empty((0, 3)), [[0, -9, 0]]):
        image = meniscus.render(meniscus.Balls(positions, 0.5), camera, meniscus.Field(), method="tile_lists")
        assert not image.hit.any()
        assert np.all(image["normal"] == 0)


def test_an_image_larger_than_a_texture_is_made_of_parts(pretend_limits, use):
    scene = SCENES["random_5000"]()
    camera = scene.camera("perspective")
    use()
    pretend_limits(texture_size=40)
    judge(image_of(scene, camera), scene, camera)
