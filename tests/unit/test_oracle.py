"""The oracle, against closed forms."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.kernels import KERNELS
from meniscus.addon.render.exact_intervals import bernstein

ALONG_Y = [[0.0, 1.0, 0.0]]


def cast_one(balls, field, origin, direction=ALONG_Y[0]):
    t, normals = meniscus.oracle.cast(balls, field, [origin], [direction])
    return t[0], normals[0]


@pytest.mark.parametrize("kernel", KERNELS)
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


@pytest.mark.parametrize("kernel", KERNELS)
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
        return (balls.weights * KERNELS[kernel].value(x)).sum(1)

    np.testing.assert_allclose(density(t[hit]), 0.4, atol=1e-10)
    for share in np.linspace(0.5, 0.999, 200):
        assert np.all(density(t[hit] * share) < 0.4 + 1e-12)


def test_oracle_rejects_unusable_rays():
    balls, field = meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field()
    with pytest.raises(InputError, match="shape"):
        meniscus.oracle.cast(balls, field, np.zeros((2, 3)), np.ones((3, 3)))
    with pytest.raises(InputError, match="no direction may be zero"):
        meniscus.oracle.cast(balls, field, np.zeros((1, 3)), np.zeros((1, 3)))


def value(p, u):
    """The definition: the sum of the coefficients times the Bernstein polynomials."""
    degree = len(p) - 1
    return sum(comb(degree, k) * u**k * (1 - u) ** (degree - k) * p[k] for k in range(degree + 1))


def test_bernstein_product_and_composition():
    generator = np.random.default_rng(5)
    p, q, u = generator.normal(size=(4, 20)), generator.normal(size=(3, 20)), generator.random(20)
    np.testing.assert_allclose(value(bernstein.product(p, q), u), value(p, u) * value(q, u))
    x = value(q, u)
    np.testing.assert_allclose(value(bernstein.compose(KERNELS["wyvill"], q), u), (5 * x**2 + 4 * x**3) / 9)


def test_bernstein_restriction():
    generator = np.random.default_rng(6)
    p, u = generator.normal(size=(7, 50)), generator.random(50)
    low, high = np.sort(generator.random((2, 50)), axis=0)
    np.testing.assert_allclose(value(bernstein.restrict(p, low, high), u), value(p, low + u * (high - low)))


def test_bernstein_value_and_slope():
    generator = np.random.default_rng(7)
    p, u = generator.normal(size=(7, 50)), generator.uniform(0.1, 0.9, 50)
    height, slope = bernstein.value_and_slope(p, u)
    np.testing.assert_allclose(height, value(p, u))
    np.testing.assert_allclose(slope, (value(p, u + 1e-6) - value(p, u - 1e-6)) / 2e-6, atol=1e-7)


def test_first_root_is_the_first_of_several():
    # (u - 0.2)(u - 0.5)(u - 0.9) rises through zero at 0.2.
    p = np.ones((1, 1))
    for root in (0.2, 0.5, 0.9):
        p = bernstein.product(p, np.array([[-root], [1 - root]]))
    np.testing.assert_allclose(bernstein.first_root(p), 0.2, atol=1e-13)
    np.testing.assert_allclose(bernstein.first_root(-p), 0.0)


def test_first_root_finds_a_double_root_and_passes_a_near_miss():
    # (u - 0.3)^2 in Bernstein form is 0.09, -0.21, 0.49.
    touching = -np.array([[0.09], [-0.21], [0.49]])
    assert bernstein.first_root(touching)[0] == pytest.approx(0.3, abs=1e-6)
    assert np.isnan(bernstein.first_root(touching - 1e-9)[0])
