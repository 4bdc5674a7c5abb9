"""The length of the way through the fluid, for light that is taken away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.kernels import KERNELS
from meniscus.addon.render.thickness import LONGEST_SIDE, at_pixels, thickness_image, typical_density

SPACING = 0.05


def slab(depth, weight=1.0, spacing=SPACING):
    """Balls on a lattice that fill a square of side 2 in x and z, `depth` deep along y."""
    side = np.arange(-1, 1, spacing) + spacing / 2
    deep = np.arange(0, depth, spacing) + spacing / 2
    x, y, z = np.meshgrid(side, deep, side, indexing="ij")
    return meniscus.Balls(np.stack([x, y, z], -1).reshape(-1, 3), 2 * spacing, weights=weight)


def view(projection, width=320, height=240):
    if projection == "perspective":
        return meniscus.Camera.perspective((0, -20, 0), (0, 0, 0), fov_y=0.1, width=width, height=height)
    return meniscus.Camera.orthographic((0, -5, 0), (0, 0, 0), scale=2.4, width=width, height=height)


def middle(image):
    height, width = image.shape
    return image[height // 2 - 5 : height // 2 + 5, width // 2 - 5 : width // 2 + 5]


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("depth", [0.5, 1.0])
def test_a_slab_is_as_thick_as_it_is(projection, depth):
    image = thickness_image(slab(depth), view(projection), meniscus.Field())
    assert image.dtype == np.float32
    assert max(image.shape) == LONGEST_SIDE
    np.testing.assert_allclose(middle(image), depth, rtol=0.12)
    assert image[:5, :5].max() == 0


def test_a_finer_fluid_is_as_thick_and_heavier_balls_as_well():
    field, camera = meniscus.Field(), view("orthographic")
    coarse, fine = (middle(thickness_image(slab(0.6, spacing=spacing), camera, field)).mean() for spacing in (0.05, 0.025))
    assert fine == pytest.approx(coarse, rel=0.1)
    heavy = middle(thickness_image(slab(0.6, weight=3.0), camera, field)).mean()
    assert heavy == pytest.approx(coarse, rel=1e-3)


def test_balls_that_carve_take_away_and_never_below_nothing():
    fluid, hole = slab(0.5), meniscus.Balls([[0, 0.25, 0]], 0.5, weights=-20.0)
    both = meniscus.Balls(
        np.concatenate([fluid.positions, hole.positions]),
        np.concatenate([fluid.radii, hole.radii]),
        weights=np.concatenate([fluid.weights, hole.weights]),
    )
    image = thickness_image(both, view("orthographic"), meniscus.Field())
    assert image.min() == 0
    assert middle(image).max() < 0.1


@pytest.mark.parametrize("kernel", KERNELS)
def test_content_is_the_integral_of_the_kernel(kernel):
    s = (np.arange(200_000) + 0.5) / 200_000
    integral = np.mean(KERNELS[kernel].value(1 - s**2) * 4 * np.pi * s**2)
    assert KERNELS[kernel].content == pytest.approx(integral, rel=1e-6)


def test_density_inside_is_that_at_the_centres_and_is_remembered():
    balls, field = slab(0.5), meniscus.Field()
    exact = [
        np.sum(KERNELS["wyvill"].value(1 - np.sum((balls.positions - center) ** 2, axis=1) / balls.radii**2))
        for center in balls.positions[np.random.default_rng(7).permutation(len(balls))[:400]]
    ]
    assert typical_density(balls, field) == pytest.approx(np.median(exact), rel=0.2)
    assert typical_density(balls, field) is typical_density(balls, field)


def test_values_at_pixels_are_interpolated():
    image = np.array([[0.0, 1.0], [2.0, 3.0]], np.float32)
    camera = view("orthographic", 4, 4)
    hit = np.ones((4, 4), np.bool_)
    expected = [[0, 0.25, 0.75, 1], [0.5, 0.75, 1.25, 1.5], [1.5, 1.75, 2.25, 2.5], [2, 2.25, 2.75, 3]]
    np.testing.assert_allclose(at_pixels(image, camera, hit).reshape(4, 4), expected, atol=1e-6)


def test_what_is_behind_the_eye_and_no_balls_give_nothing():
    camera = view("perspective")
    behind = meniscus.Balls([[0, -30, 0]], 1.0)
    assert not thickness_image(behind, camera, meniscus.Field()).any()
    assert not thickness_image(meniscus.Balls(np.empty((0, 3)), 1.0), camera, meniscus.Field()).any()


def test_water_in_a_region_is_the_same_part_of_the_whole():
    from meniscus.addon.fluid.camera import Region

    look = meniscus.Look(style="water")
    camera, balls = view("orthographic", 60, 48), slab(0.5)
    whole, part = (
        meniscus.render(balls, shown, meniscus.Field(), passes=("combined",), look=look)["combined"]
        for shown in (camera, replace(camera, region=Region(10, 8, 50, 40)))
    )
    inner = np.s_[16:32, 20:40]
    np.testing.assert_allclose(part[inner], whole[inner], atol=0.02)
