"""When surface particles follow a fluid from frame to frame, and when they begin anew."""

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import CancelledError
from meniscus.addon.render.particle_follower import LONGEST_STEP, ParticleFollower

FIELD = meniscus.Field("wyvill", 0.2)
START = np.random.default_rng(5).random((30, 3))
VELOCITY = np.array((1.0, 0.5, 0.0))


def balls_at(seconds: float) -> meniscus.Balls:
    return meniscus.Balls(START + seconds * VELOCITY, 0.25, velocities=np.tile(VELOCITY, (len(START), 1)))


@pytest.fixture
def follower():
    follower = ParticleFollower(meniscus.SurfaceParticles(500))
    follower.go_to(balls_at(0.0), FIELD, 0.0)
    return follower


def kept(follower, before) -> float:
    """The share of the particles that were there before."""
    return float(np.mean(np.isin(follower.particles.cloud.ids, before.ids)))


@pytest.mark.parametrize("seconds", [1 / 24, LONGEST_STEP, -1 / 24])
def test_they_follow_what_is_near_in_time(follower, seconds):
    before = follower.particles.cloud
    follower.go_to(balls_at(seconds), FIELD, seconds)
    assert kept(follower, before) > 0.9


@pytest.mark.parametrize("seconds", [1.01 * LONGEST_STEP, -2.0, 100.0, None])
def test_they_begin_anew_after_a_jump(follower, seconds):
    before = follower.particles.cloud
    assert follower.go_to(balls_at(0.01), FIELD, seconds).placed == 500
    assert kept(follower, before) == 0.0


def test_they_begin_anew_after_a_cut(follower):
    before = follower.particles.cloud
    far = meniscus.Balls(START + 50.0, 0.25)
    assert follower.go_to(far, FIELD, 1 / 24).placed == 500
    assert kept(follower, before) == 0.0
    assert np.all(follower.particles.cloud.positions > 40.0)


def test_they_stay_where_they_are_on_the_same_balls():
    follower, balls = ParticleFollower(meniscus.SurfaceParticles(100)), balls_at(0.0)
    follower.go_to(balls, FIELD, 0.0)
    before = follower.particles.cloud
    for seconds in (0.0, 0.04, None):
        follower.go_to(balls, FIELD, seconds)
    np.testing.assert_array_equal(follower.particles.cloud.positions, before.positions)
    follower.go_to(balls, meniscus.Field("wyvill", 0.3), 0.0)
    assert not np.array_equal(follower.particles.cloud.positions, before.positions)


def test_they_follow_what_has_rested_for_long():
    follower, balls = ParticleFollower(meniscus.SurfaceParticles(100)), balls_at(0.0)
    for seconds in (0.0, 1.0, 2.0):
        follower.go_to(balls, FIELD, seconds)
    before = follower.particles.cloud
    follower.go_to(balls_at(0.04), FIELD, 2.04)
    assert kept(follower, before) > 0.8


def test_they_begin_anew_after_what_was_interrupted(follower):
    def stop(_: float) -> None:
        raise CancelledError("stop")

    with pytest.raises(CancelledError):
        follower.go_to(balls_at(0.04), FIELD, 0.04, watch=stop)
    assert follower.go_to(balls_at(0.04), FIELD, 0.04).placed == 500
