"""Surface particles on the graphics processor: they move as those of the native core, and stay on a fluid in time."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SCENES

import meniscus
from meniscus.addon.render.surface_particles import ParticleCloud
from meniscus.gpu_shaders.context import shared_context
from meniscus.gpu_shaders.methods.surface_particles.crowds import GridCrowd, ImageCrowd, Reaches
from meniscus.gpu_shaders.methods.surface_particles.simulation import GpuSurfaceParticles, SimulationOptions
from meniscus.gpu_shaders.methods.surface_particles.state import ParticleState, Pressures

FIELD = meniscus.Field("wyvill", 0.2)
CROWDS = [ImageCrowd, GridCrowd]
FRAME = 1 / 24

FIRST_STEPS = 1e-4
"""How far particles of both processors are apart at most in the first steps, in their reaches."""


def mirrored_balls(radii) -> meniscus.Balls:
    """Moving balls about the origin: the same coordinates for both processors."""
    random = np.random.default_rng(3)
    positions = (random.random((40, 3)) - 0.5).astype(np.float32)
    velocities = np.array((1.0, 0.0, -0.5)) + random.normal(size=(40, 3)) * 0.2
    both = np.concatenate([positions, -positions]), np.concatenate([velocities, -velocities])
    return meniscus.Balls(both[0], np.tile(radii, 2), velocities=both[1])


def later(balls: meniscus.Balls, seconds: float) -> meniscus.Balls:
    return meniscus.Balls(balls.positions + seconds * balls.velocities, balls.radii, velocities=balls.velocities)


def without_some(balls: meniscus.Balls) -> meniscus.Balls:
    """A quarter of the balls are gone, with their mirror images."""
    stay = np.arange(80) % 40 >= 10
    return meniscus.Balls(balls.positions[stay], balls.radii[stay], velocities=balls.velocities[stay])


def on_gpu(kind, **options) -> GpuSurfaceParticles:
    context = shared_context()
    return GpuSurfaceParticles(context, context.run(lambda: kind(context)), SimulationOptions(**options))


@pytest.mark.parametrize("radii", [np.full(40, 0.25), np.linspace(0.06, 0.3, 40)], ids=["equal", "mixed"])
@pytest.mark.parametrize("count", [0, 2000])
@pytest.mark.parametrize("crowd", CROWDS)
def test_they_move_as_those_of_the_native_core(crowd, count, radii):
    balls = mirrored_balls(radii)
    mine, native = on_gpu(crowd, count=count, steps=3), meniscus.SurfaceParticles(count, steps=3)
    reports = [(mine.seed(balls, FIELD), native.seed(balls, FIELD))]
    following = without_some(later(balls, FRAME))
    reports.append((mine.follow(following, FIELD, FRAME), native.follow(following, FIELD, FRAME)))
    assert reports[0][1].placed > 500
    assert reports[1][1].lost > 0
    for own, other in reports:
        assert own == other
    cloud = native.cloud
    apart = np.linalg.norm(mine.positions() - cloud.positions, axis=1)
    assert np.max(apart / (native.reach * cloud.scales)) < FIRST_STEPS
    assert mine.reach == pytest.approx(native.reach, rel=1e-6)


def company(kind, positions, normals, scales, reach) -> np.ndarray:
    """How many others each particle has within its reach."""
    context = shared_context()

    def count() -> np.ndarray:
        cloud = ParticleCloud(
            *(np.ascontiguousarray(rows, np.float32) for rows in (positions, normals, normals, scales, scales)),
            np.arange(len(positions), dtype=np.uint32),
        )
        state = ParticleState.of(context, cloud)
        reaches = Reaches(reach, (float(np.min(scales)), float(np.max(scales))))
        pressures = Pressures(context, state.count)
        kind(context).press(state, reaches, 1, pressures)
        return pressures.read_company().copy()

    return context.run(count)


@pytest.mark.parametrize("crowd", CROWDS)
def test_the_search_loses_no_neighbour_however_far_droplets_are_apart(crowd):
    # Droplets a hundred thousand reaches apart, of sizes up to sixteen times one another, and a wall seen along its plane.
    random = np.random.default_rng(4)
    sizes = np.repeat([1.0, 0.25, 0.0625], 200)
    droplets = np.repeat(random.normal(size=(3, 3)) * 3e4, 200, axis=0) + random.normal(size=(600, 3)) * sizes[:, None]
    wall = np.column_stack([random.random((400, 2)) * 6, np.zeros(400)])
    positions = np.concatenate([droplets, wall]).astype(np.float32)
    scales = np.concatenate([sizes, np.ones(400)])
    normals = np.tile((0.0, 0.0, 1.0), (1000, 1))
    found = company(crowd, positions, normals, scales, 0.5)
    apart = np.linalg.norm(positions[:, None].astype(np.float64) - positions, axis=2)
    reach = 0.5 * np.minimum(scales[:, None], scales)
    expected = np.count_nonzero(apart < reach, axis=1) - 1
    assert np.median(expected) >= 2
    # Single precision decides of those at the very rim.
    assert np.count_nonzero(found != expected) <= 2
    assert np.max(np.abs(found - expected)) <= 1


@pytest.mark.parametrize("crowd", CROWDS)
def test_two_at_one_point_part(crowd):
    positions, normals = np.zeros((2, 3)), np.tile((0.0, 0.0, 1.0), (2, 1))
    np.testing.assert_array_equal(company(crowd, positions, normals, np.ones(2), 0.5), [1, 1])
    particles = on_gpu(crowd, count=2, steps=4, fills_gaps=False)
    balls = meniscus.Balls([[0, 0, 0], [0, 0, 0]], 1.0)
    particles.seed(balls, FIELD)
    assert np.linalg.norm(np.subtract(*particles.positions())) > 0.5


def render(sequence, seconds, balls=None, **settings):
    balls = later(mirrored_balls(np.full(40, 0.25)), seconds) if balls is None else balls
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=48, height=36)
    instant = meniscus.Instant(seconds, sequence)
    given = {"method": "surface_particles", "instant": instant, "settings": settings, "passes": ("depth", "normal")}
    return meniscus.render(balls, camera, FIELD, **given)


def test_images_of_a_sequence_go_on_and_others_begin_anew():
    sequence = meniscus.Sequence()
    first = render(sequence, 0.0).info.counts
    assert first["particles_placed"] == first["particles"] > 500
    following = render(sequence, FRAME).info.counts
    assert 0 < following["particles_placed"] < 0.2 * following["particles"]
    for seconds in (5.0, 0.0):
        jumped = render(sequence, seconds).info.counts
        assert jumped["particles_placed"] == jumped["particles"]
    other = render(meniscus.Sequence(), FRAME).info.counts
    assert other["particles_placed"] == other["particles"]


def test_the_same_balls_are_not_moved_again():
    sequence, balls = meniscus.Sequence(), mirrored_balls(np.full(40, 0.25))
    first = render(sequence, 0.0, balls)
    again = render(sequence, 0.0, balls)
    assert again.info.counts["particles_placed"] == 0
    np.testing.assert_array_equal(again["depth"], first["depth"])


def test_without_following_an_image_is_the_same_whatever_came_before():
    sequence = meniscus.Sequence()
    render(sequence, 0.0, follows=False)
    after = render(sequence, FRAME, follows=False)
    alone = render(meniscus.Sequence(), FRAME, follows=False)
    np.testing.assert_array_equal(after["depth"], alone["depth"])


def test_too_few_particles_are_told():
    balls = meniscus.Balls([[x, 0, 0] for x in range(-10, 11)], 0.4)
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=24, width=60, height=60)
    image = meniscus.render(balls, camera, FIELD, method="surface_particles", settings={"particles": 30})
    assert any("too few" in note for note in image.info.notes)
    image = meniscus.render(balls, camera, FIELD, method="surface_particles")
    assert image.info.notes == ()


def test_discs_alone_show_the_surface_less_exactly_but_whole():
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    exact = meniscus.render(scene.balls, camera, scene.field, method="tile_caster")
    settings = {"exact": False, "particles": 4000}
    discs = meniscus.render(scene.balls, camera, scene.field, method="surface_particles", settings=settings)
    assert np.all(discs.hit[exact.hit])
    both = discs.hit & exact.hit
    error = np.abs(discs["depth"] - exact["depth"])[both] / np.min(scene.balls.radii)
    assert np.sqrt(np.mean(np.sort(error)[: int(0.99 * len(error))] ** 2)) < 0.01
