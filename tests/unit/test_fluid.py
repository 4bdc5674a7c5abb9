"""Balls, fields, kernels and passes."""

from __future__ import annotations

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.kernels import KERNELS
from meniscus.addon.fluid.passes import checked_passes
from meniscus.addon.render import native

BALL = meniscus.Balls([[0, 0, 0]], 1.0)
X = np.linspace(0, 1, 1001)
PRINTED = {
    # In s = r / R, as the papers print them.
    "wyvill": lambda s: 1 - 22 / 9 * s**2 + 17 / 9 * s**4 - 4 / 9 * s**6,
    "quartic": lambda s: (1 - s**2) ** 2,
    "poly6": lambda s: (1 - s**2) ** 3,
    "power_4": lambda s: (1 - s**2) ** 4,
    "power_1": lambda s: 1 - s**2,
    "mishima": lambda s: (1 - s) ** 2,
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_is_the_printed_one(name):
    s = np.sqrt(1 - X)
    np.testing.assert_allclose(KERNELS[name].value(X), PRINTED[name](s), atol=1e-14)


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_derivative_is_the_slope_of_its_value(name):
    middle, step = X[1:-1], 1e-6
    slope = (KERNELS[name].value(middle + step) - KERNELS[name].value(middle - step)) / (2 * step)
    np.testing.assert_allclose(KERNELS[name].derivative(middle), slope, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_is_zero_outside_the_influence_sphere(name):
    outside = np.array([-2.0, -1e-9, 0.0])
    assert np.all(KERNELS[name].value(outside) == 0)
    assert np.all(KERNELS[name].derivative(outside) == 0)


@pytest.mark.parametrize("name", KERNELS)
def test_kernel_inverse(name):
    np.testing.assert_allclose(KERNELS[name].value(KERNELS[name].inverse(X)), X, atol=1e-14)
    assert np.all(np.isnan(KERNELS[name].inverse(np.array([-0.1, 1.1, np.inf, np.nan]))))


def test_kernel_radius_is_where_a_lone_ball_has_the_isovalue():
    radii, weights = np.array([2.0, 2.0, 1.0, 1.0]), np.array([1.0, 3.0, 0.1, -1.0])
    kernel_radii = meniscus.Field("poly6", 0.3).kernel_radii(radii, weights)
    density = weights * (1 - (kernel_radii / radii) ** 2) ** 3
    np.testing.assert_allclose(density[:2], 0.3)
    assert np.all(kernel_radii[2:] == 0)


def test_the_surface_of_mishimas_kernel_is_where_the_root_of_the_sum_is_the_isovalue():
    # Mishima et al. 2008, section 6: h = 0.61, T = 0.765625; alone a ball has the radius h (1 - T).
    field = meniscus.Field("mishima", 0.765625)
    assert field.threshold == 0.765625**2
    assert field.kernel_radii(np.array([0.61]), np.ones(1))[0] == pytest.approx(0.61 * (1 - 0.765625))
    assert field.kernel_radii(np.array([0.61]), np.array([4.0]))[0] == pytest.approx(0.61 * (1 - 0.765625 / 2))


def test_the_slope_of_mishimas_kernel_has_a_limit_at_the_centre_by_distance_only():
    kernel = KERNELS["mishima"]
    s = np.geomspace(1e-3, 0.5, 50)
    np.testing.assert_allclose(2 * s * kernel.derivative(1 - s**2), 2 * (1 - s), rtol=1e-9)
    assert 1000 < kernel.derivative(np.float64(1)) < np.inf
    # The gradient, which has the distance as a factor, never exceeds the limit.
    nearest = np.linspace(0, 1e-3, 1001)
    assert np.all(2 * nearest * kernel.derivative(1 - nearest**2) <= 2.0)


@pytest.mark.parametrize("name", KERNELS)
def test_steepest_slope_is_that_of_the_kernel_by_distance(name):
    s = np.linspace(0, 1, 20_001)
    steps = np.abs(np.diff(KERNELS[name].value(1 - s**2))) / np.diff(s)
    assert np.max(steps) <= KERNELS[name].steepest_slope * (1 + 1e-6)
    assert np.max(steps) == pytest.approx(KERNELS[name].steepest_slope, rel=1e-3)


def test_a_density_profile_is_the_kernel_that_its_table_is_of():
    exact = KERNELS["wyvill"]
    profile = meniscus.DensityProfile(exact.value(1 - np.linspace(0, 1, 1001) ** 2))
    assert profile == meniscus.DensityProfile(profile.densities)
    assert hash(meniscus.Field(profile)) == hash(meniscus.Field(meniscus.DensityProfile(profile.densities)))
    np.testing.assert_allclose(profile.value(X), exact.value(X), atol=1e-5)
    np.testing.assert_allclose(profile.derivative(X[10:-10]), exact.derivative(X[10:-10]), rtol=0.02, atol=5e-3)
    np.testing.assert_allclose(profile.value(profile.inverse(X)), X, atol=1e-12)
    assert np.isnan(profile.inverse(np.array([-0.1, 1.1]))).all()
    assert profile.content == pytest.approx(exact.content, rel=1e-5)
    assert profile.steepest_slope == pytest.approx(exact.steepest_slope, rel=1e-4)
    radii = [meniscus.Field(own, 0.3).kernel_radii(np.ones(1), np.array([2.0]))[0] for own in ("wyvill", profile)]
    assert radii[1] == pytest.approx(radii[0], rel=1e-5)


@pytest.mark.parametrize(
    ("densities", "reason"),
    [
        ([1.0, 0.5, 0.1], "end at 0"),
        ([1.0, np.nan, 0.0], "finite"),
        ([1.0, np.inf, 0.0], "finite"),
        ([0.5, 1.0, 0.0], "fall"),
        ([0.0, 0.0], "fall"),
        ([0.0], "2 to 1024"),
        (np.linspace(1, 0, 1025), "2 to 1024"),
        ([[1.0, 0.0]], "2 to 1024"),
        (["much", "nothing"], "numbers"),
    ],
)
def test_unusable_density_profiles_are_refused(densities, reason):
    with pytest.raises(InputError, match=reason):
        meniscus.DensityProfile(densities)


@pytest.mark.parametrize("use", [lambda field: native.fluid_arguments(BALL, field), lambda field: field.polynomial_kernel])
def test_a_kernel_that_is_no_polynomial_is_refused_where_one_is_needed(use):
    with pytest.raises(InputError, match="Mishima is no polynomial"):
        use(meniscus.Field("mishima", 0.7))


def test_balls_repeat_single_values():
    balls = meniscus.Balls(np.zeros((3, 3)), 0.5, colors=(1, 0, 0))
    assert balls.radii.tolist() == [0.5] * 3
    assert balls.weights.tolist() == [1] * 3
    assert balls.colors.shape == (3, 3)
    assert balls.velocities is None
    assert all(array.dtype == np.float32 and array.flags.c_contiguous for array in (balls.positions, balls.radii, balls.colors))


def test_balls_drop_only_what_is_unusable_and_say_so():
    positions = np.zeros((6, 3))
    positions[1, 2], positions[2, 0] = np.nan, np.inf
    balls = meniscus.Balls(positions, [1, 1, 1, 0, -2, 1], ids=np.arange(6), velocities=np.eye(6, 3))
    assert balls.ids.tolist() == [0, 5]
    assert balls.velocities.tolist() == [[1, 0, 0], [0, 0, 0]]
    assert balls.dropped == {"position is not finite": 2, "radius is not greater than zero": 2}
    assert balls.dropped_text.startswith("4 balls were left out: 2 whose position is not finite")


def test_balls_drop_radii_and_weights_that_are_not_finite():
    balls = meniscus.Balls(np.zeros((4, 3)), [1, np.nan, np.inf, 1], weights=[1, 1, 1, np.nan])
    assert len(balls) == 1
    assert balls.dropped == {"radius is not finite": 2, "weight is not finite": 1}


def test_balls_do_not_copy_whole_float32_arrays():
    positions = np.zeros((5, 3), np.float32)
    assert np.shares_memory(meniscus.Balls(positions, 1.0).positions, positions)
    assert positions.flags.writeable


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"positions": np.zeros((4, 2))}, "positions must have the shape (N, 3), not (4, 2)"),
        ({"radii": np.ones(3)}, "radii must have the shape (4,)"),
        ({"colors": np.ones((4, 4))}, "colors must have the shape (4, 3)"),
        ({"positions": ["a", "b"]}, "positions must be an array of numbers"),
    ],
)
def test_balls_name_the_shape_they_expect(arguments, expected):
    with pytest.raises(InputError) as caught:
        meniscus.Balls(**{"positions": np.zeros((4, 3)), "radii": 1.0, **arguments})
    assert expected in str(caught.value)


@pytest.mark.parametrize(("kernel", "isovalue"), [("gauss", 0.2), ("wyvill", 0.0), ("wyvill", -1.0), ("wyvill", float("nan"))])
def test_field_rejects_what_has_no_surface(kernel, isovalue):
    with pytest.raises(InputError):
        meniscus.Field(kernel, isovalue)


def test_passes_are_checked_in_order_and_once():
    assert checked_passes(["normal", "depth", "normal"]) == ("normal", "depth")
    with pytest.raises(InputError, match="Unknown pass 'dpeth': choose from"):
        checked_passes(["depth", "dpeth"])
    with pytest.raises(InputError, match="No pass"):
        checked_passes([])
