"""Surface particles, from Python."""

import numpy as np
import pytest
from bench import van_kooten_2007, van_kooten_scenes
from bench.van_kooten_scenes import fountain

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.particle_follower import ParticleFollower

FIELD = meniscus.Field("wyvill", 0.2)
RANDOM = np.random.default_rng(3)
BALLS = meniscus.Balls(RANDOM.random((40, 3)), 0.25, velocities=np.tile((1.0, 0.0, -0.5), (40, 1)))


def test_particles_lie_on_the_surface_and_face_out_of_it():
    particles = meniscus.SurfaceParticles(2000)
    assert particles.seed(BALLS, FIELD).placed == 2000
    cloud = particles.cloud
    # A ray from a little outside, against the normal, meets the surface where the particle is.
    origins = cloud.positions + 0.01 * cloud.normals
    t, normals = meniscus.oracle.cast(BALLS, FIELD, origins, -cloud.normals)
    assert np.sqrt(np.mean((t - 0.01) ** 2)) < 1e-3 * 0.25
    assert np.all(np.sum(normals * cloud.normals, axis=1) > 0.999)
    np.testing.assert_allclose(cloud.velocities, np.tile((1.0, 0.0, -0.5), (2000, 1)), atol=1e-4)
    assert len(set(cloud.ids)) == 2000


def test_each_place_of_the_surface_has_a_particle_nearby():
    particles = meniscus.SurfaceParticles(4000, steps=10)
    particles.seed(BALLS, FIELD)
    cloud = particles.cloud
    camera = meniscus.Camera.perspective((3, -2, 1.5), (0.5, 0.5, 0.5), fov_y=0.5, width=64, height=64)
    image = meniscus.render(BALLS, camera, FIELD, method="tile_caster", passes=("depth", "position"))
    seen = image["position"][image.hit]
    nearest = np.linalg.norm(seen[:, None] - cloud.positions[None], axis=2).min(axis=1)
    assert np.mean(nearest < np.median(cloud.spacings)) > 0.999


def test_particles_keep_their_numbers_while_the_fluid_moves():
    particles = meniscus.SurfaceParticles(1000)
    particles.seed(BALLS, FIELD)
    before = particles.cloud
    later = meniscus.Balls(BALLS.positions + 0.1 * BALLS.velocities, 0.25, velocities=BALLS.velocities)
    report = particles.follow(later, FIELD, 0.1)
    after = particles.cloud
    assert report.lost == 0
    kept, first, second = np.intersect1d(before.ids, after.ids, return_indices=True)
    assert len(kept) >= 1000 - report.placed - report.dispersed > 900
    moved = after.positions[second] - before.positions[first]
    assert np.median(np.linalg.norm(moved - 0.1 * BALLS.velocities[0], axis=1)) < 0.3 * np.median(after.spacings)


@pytest.mark.parametrize("threads", [1, 3])
def test_particles_are_the_same_for_any_number_of_threads(threads):
    clouds = []
    for count in (threads, 2):
        particles = meniscus.SurfaceParticles(500)
        particles.seed(BALLS, FIELD, threads=count)
        clouds.append(particles.cloud)
    np.testing.assert_array_equal(clouds[0].positions, clouds[1].positions)


def test_what_cannot_be_is_told_in_a_sentence():
    with pytest.raises(InputError, match="at most 16777216 surface particles"):
        meniscus.SurfaceParticles(2**24 + 1)
    with pytest.raises(InputError, match="steps in a frame"):
        meniscus.SurfaceParticles(steps=10**6)
    with pytest.raises(InputError, match="cell size"):
        meniscus.SurfaceParticles(cell_share=3.0)
    particles = meniscus.SurfaceParticles(10)
    with pytest.raises(InputError, match="seconds"):
        particles.follow(BALLS, FIELD, 1e9)
    with pytest.raises(InputError, match="polynomial"):
        particles.seed(BALLS, meniscus.Field("mishima", 0.7))
    assert particles.seed(BALLS, meniscus.Field("wyvill", 1e9)).placed == 0
    assert len(particles.cloud.ids) == 0


@pytest.mark.slow
def test_particles_stay_on_a_fountain_through_a_hundred_frames():
    follower = ParticleFollower(meniscus.SurfaceParticles(steps=10))
    for frame in range(101):
        balls = fountain(1.0 + frame / 24)
        report = follower.go_to(balls, van_kooten_scenes.FIELD, 1.0 + frame / 24)
        cloud = follower.particles.cloud
        assert frame == 0 or report.placed < 0.3 * len(cloud.ids), "they should go on from frame to frame"
        if frame % 25 == 0:
            assert van_kooten_2007.distance_rms(cloud, balls) <= 0.01
            assert van_kooten_2007.variation(cloud) <= 0.25
            assert van_kooten_2007.covered(balls, cloud) >= 0.995
