"""The oracle, against closed forms."""

from __future__ import annotations

import _thread
import signal
import threading

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.kernels import POLYNOMIAL_KERNELS

ALONG_Y = [[0.0, 1.0, 0.0]]


def cast_one(balls, field, origin, direction=ALONG_Y[0]):
    t, normals = meniscus.oracle.cast(balls, field, [origin], [direction])
    return t[0], normals[0]


@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
def test_one_ball_is_its_kernel_sphere(kernel):
    field = meniscus.Field(kernel, 0.3)
    balls = meniscus.Balls([[0, 0, 0]], 2.0)
    radius = field.kernel_radii(np.array([2.0]), np.array([1.0]))[0]
    offsets = np.linspace(-1, 1, 41) * radius * 0.999
    origins = np.stack([offsets, np.full(41, -5.0), np.zeros(41)], 1)
    t, normals = meniscus.oracle.cast(balls, field, origins, np.repeat(ALONG_Y, 41, 0))
    np.testing.assert_allclose(t, 5 - np.sqrt(radius**2 - offsets**2), atol=1e-12)
    hits = origins + t[:, None] * ALONG_Y
    np.testing.assert_allclose(normals, hits / radius, atol=1e-10)


def test_ray_past_the_kernel_sphere_misses():
    field = meniscus.Field("quartic", 0.25)
    balls = meniscus.Balls([[0, 0, 0]], 1.0)
    radius = np.sqrt(0.5)
    assert np.isfinite(cast_one(balls, field, (radius - 1e-9, -3, 0))[0])
    t, normal = cast_one(balls, field, (radius + 1e-9, -3, 0))
    assert np.isinf(t)
    assert not normal.any()


def test_two_equal_balls_along_the_ray():
    # With quartic kernels at distance d: (1 - u^2)^2 + (1 - (u - d)^2)^2 = T, front surface below the first centre.
    d, isovalue = 0.8125, 0.5
    balls = meniscus.Balls([[0, 0, 0], [0, d, 0]], 1.0)
    t, normal = cast_one(balls, meniscus.Field("quartic", isovalue), (0, -4, 0))
    u = t - 4
    assert u < 0
    second = max(1 - (u - d) ** 2, 0) ** 2
    assert (1 - u**2) ** 2 + second == pytest.approx(isovalue, abs=1e-12)
    np.testing.assert_allclose(normal, (0, -1, 0), atol=1e-12)


def test_two_equal_balls_across_the_ray_meet_in_the_middle():
    # Half way both densities are equal: 2 f(1 - (h^2 + y^2)) = T.
    h, isovalue = 0.4375, 0.3
    balls = meniscus.Balls([[-h, 0, 0], [h, 0, 0]], 1.0)
    t, normal = cast_one(balls, meniscus.Field("poly6", isovalue), (0, -4, 0))
    y = np.sqrt(1 - h**2 - (isovalue / 2) ** (1 / 3))
    assert t == pytest.approx(4 - y, abs=1e-12)
    np.testing.assert_allclose(normal, (0, -1, 0), atol=1e-12)


def test_coincident_balls_add_up():
    field = meniscus.Field("wyvill", 0.2)
    several = meniscus.Balls(np.zeros((5, 3)), 1.0, weights=[0.5, 0.125, 0.125, 0.1875, 0.0625])
    one = meniscus.Balls([[0, 0, 0]], 1.0)
    for origin in ((0, -4, 0), (0.3, -4, 0.2), (0.7, -4, 0)):
        assert cast_one(several, field, origin)[0] == pytest.approx(cast_one(one, field, origin)[0], abs=1e-12)


def test_ray_that_starts_inside_sees_the_surface_from_within():
    balls = meniscus.Balls([[0, 0, 0]], 1.0)
    t, normal = cast_one(balls, meniscus.Field("quartic", 0.25), (0, 0, 0))
    assert t == pytest.approx(np.sqrt(0.5), abs=1e-12)
    np.testing.assert_allclose(normal, (0, 1, 0), atol=1e-12)


def test_surface_behind_the_origin_is_not_seen():
    assert np.isinf(cast_one(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field(), (0, 1.5, 0))[0])


def test_surface_behind_the_origin_hides_nothing_ahead():
    # The ray starts outside the fluid, behind a kernel sphere whose influence sphere it is still in.
    field = meniscus.Field("quartic", 0.25)
    balls = meniscus.Balls([[0, 0, 0], [0, 4, 0]], 1.0)
    t, normal = cast_one(balls, field, (0, 0.9, 0))
    assert t == pytest.approx(4 - np.sqrt(0.5) - 0.9, abs=1e-12)
    np.testing.assert_allclose(normal, (0, -1, 0), atol=1e-12)


def test_directions_need_not_be_unit():
    balls, field = meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field()
    assert cast_one(balls, field, (0, -4, 0), (0, 50, 0))[0] == pytest.approx(cast_one(balls, field, (0, -4, 0))[0], abs=1e-12)


@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
def test_density_at_the_hit_is_the_isovalue_and_less_before(kernel):
    generator = np.random.default_rng(11)
    balls = meniscus.Balls(generator.random((300, 3)), generator.uniform(0.1, 0.3, 300), generator.uniform(0.5, 1.5, 300))
    field = meniscus.Field(kernel, 0.4)
    target, origins = generator.random((200, 3)), np.tile([-3.0, -2.0, 0.7], (200, 1))
    t, _ = meniscus.oracle.cast(balls, field, origins, target - origins)
    hit = np.isfinite(t)
    assert hit.sum() > 150
    directions = (target - origins)[hit] / np.linalg.norm((target - origins)[hit], axis=1, keepdims=True)

    def density(distance):
        points = origins[hit] + distance[:, None] * directions
        x = 1 - ((points[:, None] - balls.positions) ** 2).sum(-1) / balls.radii.astype(float) ** 2
        return (balls.weights * POLYNOMIAL_KERNELS[kernel].value(x)).sum(1)

    np.testing.assert_allclose(density(t[hit]), 0.4, atol=1e-10)
    for share in np.linspace(0.5, 0.999, 200):
        assert np.all(density(t[hit] * share) < 0.4 + 1e-12)


def test_crossings_of_one_ball_are_its_front_and_its_back():
    balls, field = meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field("quartic", 0.25)
    origins = [[0, -4, 0], [2, -4, 0], [0, 0, 0], [0.5, -4, 0]]
    rays, t, is_entering = meniscus.oracle.crossings(balls, field, origins, ALONG_Y * 4)
    assert (rays.dtype, t.dtype, is_entering.dtype) == (np.int64, np.float64, np.bool_)
    np.testing.assert_array_equal(rays, [0, 0, 2, 3, 3])
    np.testing.assert_array_equal(is_entering, [True, False, False, True, False])
    half = np.sqrt(0.5)
    np.testing.assert_allclose(t, [4 - half, 4 + half, half, 3.5, 4.5], atol=1e-12)


def test_a_ball_that_carves_makes_a_hollow():
    # On the axis x^2 - x^2 (r = 1/2) with 1 - y^2 and 1 - 4 y^2: the hollow's wall is where the difference is T.
    balls, field = meniscus.Balls([[0, 0, 0]] * 2, [1, 0.5], weights=[1, -1]), meniscus.Field("quartic", 0.5)
    _, t, is_entering = meniscus.oracle.crossings(balls, field, [[0, -4, 0]], ALONG_Y)
    front, wall = np.sqrt(1 - np.sqrt(0.5)), np.sqrt((3 - np.sqrt(1.5)) / 15)
    np.testing.assert_allclose(t - 4, [-front, -wall, wall, front], atol=1e-12)
    np.testing.assert_array_equal(is_entering, [True, False, True, False])


@pytest.mark.parametrize("kernel", POLYNOMIAL_KERNELS)
def test_a_place_is_in_the_fluid_after_an_odd_number_of_crossings_on_the_way(kernel):
    generator = np.random.default_rng(12)
    weights = generator.uniform(0.5, 1.5, 40) * generator.choice([1, 1, 1, -1], 40)
    balls = meniscus.Balls(generator.random((40, 3)), generator.uniform(0.1, 0.4, 40), weights)
    field = meniscus.Field(kernel, 0.4)
    places = generator.random((20000, 3)) * 1.4 - 0.2
    origins = generator.normal(size=(20000, 3)) * 2 + 5
    rays, t, _ = meniscus.oracle.crossings(balls, field, origins, places - origins)
    on_the_way = t < np.linalg.norm(places - origins, axis=1)[rays]
    is_inside = np.bincount(rays[on_the_way], minlength=20000) % 2 == 1
    x = 1 - ((places[:, None] - balls.positions) ** 2).sum(-1) / balls.radii.astype(float) ** 2
    excess = (balls.weights * POLYNOMIAL_KERNELS[kernel].value(x)).sum(1) - field.isovalue
    np.testing.assert_array_equal(is_inside, excess > 0)
    assert 0.02 < is_inside.mean() < 0.98


def test_ray_and_ball_arrays_of_any_layout_will_do():
    balls, field = meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field()
    origins = np.asfortranarray([[0, -4, 0], [0.25, -4, 0]], np.float32)
    expected = meniscus.oracle.cast(balls, field, [[0, -4, 0], [0.25, -4, 0]], ALONG_Y * 2)[0]
    np.testing.assert_array_equal(meniscus.oracle.cast(balls, field, origins, np.array(ALONG_Y * 2)[::-1])[0], expected)
    assert meniscus.oracle.cast(balls, field, np.zeros((0, 3)), np.zeros((0, 3)))[1].shape == (0, 3)


@pytest.mark.parametrize("find", [meniscus.oracle.cast, meniscus.oracle.crossings])
@pytest.mark.parametrize(
    ("origins", "directions", "sentence"),
    [
        (np.zeros((2, 3)), np.ones((3, 3)), "one direction for each of the 2 origins, not 3"),
        (np.zeros((2, 2)), np.ones((2, 3)), r"origins must be .* of the shape \(N, 3\), not of the shape \(2, 2\)"),
        (np.zeros(3), np.ones(3), r"origins must be .* of the shape \(N, 3\)"),
        (np.zeros((1, 3)), np.zeros((1, 3)), "no direction may be zero; that of ray 0"),
        (np.zeros((2, 3)), [[1, 0, 0], [np.nan, 0, 0]], "directions must be finite.* that of ray 1"),
        ([[np.inf, 0, 0]], [[1, 0, 0]], "origins must be finite; that of ray 0"),
        (np.zeros((1, 3)), [["a", "b", "c"]], "directions must be an array of numbers"),
    ],
)
def test_unusable_rays_are_refused_with_a_sentence(find, origins, directions, sentence):
    with pytest.raises(InputError, match=sentence):
        find(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field(), origins, directions)


def test_ctrl_c_ends_a_long_cast():
    # A process that a script starts in the background ignores Ctrl-C until it says otherwise.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    # Two hundred balls too thin to make a surface: every interval of every ray is looked at, for minutes.
    positions = np.random.default_rng(13).random((200, 3)) * 0.1
    balls, field = meniscus.Balls(positions, 1.0, weights=1e-4), meniscus.Field()
    origins = np.tile([0.0, -4.0, 0.0], (200_000, 1))
    interrupt = threading.Timer(0.1, _thread.interrupt_main)
    interrupt.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            meniscus.oracle.cast(balls, field, origins, np.tile(ALONG_Y, (200_000, 1)))
    finally:
        signal.signal(signal.SIGINT, before)
