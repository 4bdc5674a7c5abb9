"""Disc Caster: what it draws of surface particles on the processor, and how far it may be off."""

import numpy as np
import pytest
from bench import van_kooten_scenes
from bench.scenes import three_quarter_camera

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.method import Surface
from meniscus.samples import block, jets

FIELD = meniscus.Field("wyvill", 0.2)
CAMERA = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=48, height=36)
RANDOM = np.random.default_rng(3)
BALLS = meniscus.Balls(
    RANDOM.random((40, 3)) - 0.5, 0.25, colors=RANDOM.random((40, 3)), velocities=np.tile((1.0, 0.0, -0.5), (40, 1))
)

SAMPLES = {
    "glass": (van_kooten_scenes.glass, van_kooten_scenes.FIELD),
    "fountain": (lambda: van_kooten_scenes.fountain(1.0), van_kooten_scenes.FIELD),
    "jets": (lambda: jets.balls(150), meniscus.Field()),
    "block": (lambda: block.balls(2000), meniscus.Field("wyvill", 0.4)),
}
"""Balls and field; a block with droplets stands for the dam break."""


def render(balls=BALLS, camera=CAMERA, field=FIELD, method="disc_caster", **options):
    return meniscus.render(balls, camera, field, method=method, **options)


def rms(errors) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def nearest_of_the_same_side(cloud) -> np.ndarray:
    """The distance of each particle to the next one that faces the same way, in the radii of the balls there."""
    apart = np.linalg.norm(cloud.positions[:, None] - cloud.positions, axis=2)
    apart[(cloud.normals @ cloud.normals.T <= 0) | np.eye(len(apart), dtype=bool)] = np.inf
    found = apart.min(axis=1) / cloud.scales
    return found[np.isfinite(found)]


@pytest.mark.parametrize("name", SAMPLES)
def test_ten_steps_cover_the_samples_evenly_and_on_the_surface(name):
    make, field = SAMPLES[name]
    balls = make()
    camera = three_quarter_camera(balls, 200, 150)
    expected = render(balls, camera, field, method="tile_caster")
    for settings in ({}, {"exact": False}):
        image = render(balls, camera, field, settings=settings)
        assert np.mean(image.hit[expected.hit]) >= 0.995
        both = expected.hit & image.hit
        errors = np.abs(image["depth"] - expected["depth"])[both] / np.median(balls.radii)
        # At silhouettes a ray may see another part; discs alone are off by as much as they bend otherwise than the surface.
        assert rms(np.sort(errors)[: int((0.95 if settings else 0.999) * len(errors))]) <= (0.02 if settings else 1e-4)
    particles = meniscus.SurfaceParticles(steps=10)
    particles.seed(balls, field)
    cloud = particles.cloud
    start = cloud.positions.astype(np.float64) + 0.02 * cloud.scales[:, None] * cloud.normals
    t, _ = meniscus.oracle.cast(balls, field, start, -cloud.normals.astype(np.float64))
    found = np.isfinite(t)
    assert np.mean(found) > 0.999
    assert rms((t / cloud.scales - 0.02)[found]) <= 0.01
    chosen = nearest_of_the_same_side(cloud)
    assert np.std(chosen) / np.mean(chosen) <= 0.25


def test_an_image_is_the_same_for_any_number_of_threads():
    passes = ("depth", "normal", "color")
    for settings in ({}, {"exact": False}):
        images = [render(threads=threads, settings=settings, passes=passes) for threads in (1, 3)]
        for name in passes:
            np.testing.assert_array_equal(images[0][name], images[1][name])


def test_attributes_are_those_of_the_fluid_where_it_is_seen():
    passes = ("depth", "color", "velocity")
    image, expected = (render(method=method, passes=passes) for method in ("disc_caster", "tile_caster"))
    both = image.hit & expected.hit & (np.abs(image["depth"] - expected["depth"]) < 1e-4)
    assert np.mean(both[expected.hit]) > 0.99
    for name in passes:
        np.testing.assert_allclose(image[name][both], expected[name][both], atol=2e-4)


def test_the_same_balls_are_not_moved_again_for_another_camera():
    instant = meniscus.Instant(1.0, meniscus.Sequence())
    first = render(instant=instant).info.counts
    assert first["particles_placed"] == first["particles"] > 200
    other = meniscus.Camera.orthographic((4, 0, 0), (0, 0, 0), scale=2, width=30, height=20)
    again = render(camera=other, instant=instant)
    assert again.info.counts["particles_placed"] == 0
    assert again.hit.any()


def test_discs_alone_know_nothing_of_the_surface_between_particles():
    """Few particles lie far apart: exact pictures are on the surface, pictures of the discs are not."""
    settings = {"particles": 70}
    expected = render(method="tile_caster")
    errors = []
    for exact in (True, False):
        image = render(settings={**settings, "exact": exact})
        both = image.hit & expected.hit
        errors.append(np.median(np.abs(image["depth"] - expected["depth"])[both]))
    assert errors[0] < 1e-5
    assert errors[1] > 1e-3


def test_where_there_is_no_surface_nothing_is_drawn():
    none = meniscus.Balls(np.zeros((0, 3)), 1.0)
    hollow = meniscus.Balls([[0, 0, 0], [0, 0, 0]], 1.0, weights=[1, -1])
    for balls, field in ((none, FIELD), (BALLS, meniscus.Field("wyvill", 1e9)), (hollow, FIELD)):
        image = render(balls, field=field)
        assert not image.hit.any()
        assert image.info.counts["particles"] == 0
        assert np.all(image["depth"] == np.float32(1e10))


def test_balls_at_one_point_are_one_ball():
    pair = meniscus.Balls([[0, 0, 0], [0, 0, 0]], 1.0, weights=[0.5, 0.5])
    one = meniscus.Balls([[0, 0, 0]], 1.0)
    images = [render(balls) for balls in (pair, one)]
    np.testing.assert_array_equal(images[0].hit, images[1].hit)
    np.testing.assert_allclose(images[0]["depth"], images[1]["depth"], rtol=1e-6)


def test_velocities_may_be_missing_but_not_be_no_numbers():
    assert render(meniscus.Balls(BALLS.positions, 0.25)).hit.any()
    velocities = np.array(BALLS.velocities)
    velocities[:3, 1] = np.nan
    broken = meniscus.Balls(BALLS.positions, 0.25, velocities=velocities)
    with pytest.raises(
        InputError, match="3 of 40 balls have a velocity that is not finite: correct these, or give no velocities"
    ):
        render(broken)


def test_particles_that_cannot_cover_a_fluid_are_told():
    row = meniscus.Balls([[x, 0, 0] for x in range(-10, 11)], 0.4)
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=24, width=60, height=60)
    image = render(row, camera, settings={"particles": 10})
    assert image.info.counts["particles"] == 10
    assert any("10 surface particles are too few" in note for note in image.info.notes)
    assert render(row, camera).info.notes == ()


def test_what_cannot_be_drawn_is_told_in_a_sentence():
    particles, surface = meniscus.SurfaceParticles(), Surface.background(CAMERA)
    with pytest.raises(InputError, match="must be seeded before they are drawn"):
        particles.draw(BALLS, CAMERA, surface, is_exact=True)
    particles.seed(BALLS, FIELD)
    particles.draw(BALLS, CAMERA, surface, is_exact=True)
    assert surface.hit.any()
    colored = Surface.background(CAMERA, ("color",))
    fewer = meniscus.Balls(BALLS.positions[:7], 0.25, colors=BALLS.colors[:7])
    with pytest.raises(InputError, match="a row for each ball"):
        particles.draw(fewer, CAMERA, colored, is_exact=True)
    with pytest.raises(InputError, match="polynomial"):
        render(field=meniscus.Field("mishima", 0.7))
