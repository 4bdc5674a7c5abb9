"""What stands for balls and liquids: kernel spheres, and ellipsoids with the exact second moments."""

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.displays import DISPLAYS
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.cluster_numbers import number_clusters
from meniscus.addon.render.glyphs import ellipsoid_glyphs, glyphs_of, sphere_glyphs
from meniscus.addon.render.method import Request
from meniscus.addon.render.renderer import UNTRACED

FIELD = meniscus.Field("wyvill", 0.4)
CAMERA = meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), fov_y=0.6, width=40, height=30)


def ellipsoids(balls, field=FIELD):
    found = number_clusters(balls, field)
    return ellipsoid_glyphs(balls, field, found.numbers, len(found.sizes))


def lengths(glyphs):
    return np.linalg.norm(glyphs.extents.reshape(-1, 3, 3), axis=2)


def render(balls, display, field=FIELD, **options):
    return meniscus.render(balls, CAMERA, field, **{"backend": "cpu", "display": display} | options)


def test_a_ball_is_its_kernel_sphere():
    balls = meniscus.Balls([(0, 0, 0), (3, 0, 0), (6, 0, 0)], [1.0, 0.5, 1.0], [1.0, 2.0, 0.2])
    glyphs = sphere_glyphs(balls, FIELD)
    np.testing.assert_allclose(glyphs.extents, FIELD.kernel_radii(balls.radii, balls.weights)[:2], rtol=1e-6)
    assert glyphs.balls.tolist() == [0, 1]
    assert (len(glyphs), glyphs.without_surface) == (2, 1)


def test_an_ellipsoid_of_one_ball_is_its_kernel_sphere():
    """Also far from the origin, where squares of coordinates have no digits left for a radius."""
    balls = meniscus.Balls([(1e5, -2e5, 3e5), (0, 0, 0)], [1.0, 0.01])
    glyphs = ellipsoids(balls)
    np.testing.assert_array_equal(glyphs.centers, balls.positions)
    np.testing.assert_allclose(
        lengths(glyphs), np.repeat(FIELD.kernel_radii(balls.radii, balls.weights)[:, None], 3, axis=1), rtol=1e-6
    )


def test_the_axes_of_two_balls_follow_from_their_distance():
    """Second moments of two solid balls of radius r at a distance 2 d: d^2 + r^2/5 along it, r^2/5 across."""
    along = np.array([1, 2, 2]) / 3
    distance = 0.4
    balls = meniscus.Balls([5 - distance * along, 5 + distance * along], 1.0)
    glyphs = ellipsoids(balls)
    radius = FIELD.kernel_radii(balls.radii, balls.weights)[0]
    np.testing.assert_allclose(glyphs.centers, [(5, 5, 5)], rtol=1e-6)
    expected = [radius, radius, np.sqrt(5 * distance**2 + radius**2)]
    np.testing.assert_allclose(np.sort(lengths(glyphs)[0]), expected, rtol=1e-5)
    longest = glyphs.extents.reshape(3, 3)[np.argmax(lengths(glyphs)[0])]
    assert abs(longest @ along) == pytest.approx(expected[2], rel=1e-5)


def test_second_moments_are_those_of_points_in_the_solid_balls():
    random = np.random.default_rng(3)
    balls = meniscus.Balls(random.uniform(-0.6, 0.6, (12, 3)) * [3, 1, 0.5], random.uniform(0.6, 1.0, 12))
    assert len(number_clusters(balls, FIELD).sizes) == 1
    glyphs = ellipsoids(balls)
    radii = FIELD.kernel_radii(balls.radii, balls.weights)
    owner = random.choice(12, 400_000, p=radii**3 / np.sum(radii**3))
    points = random.normal(size=(400_000, 3))
    points *= (random.random(400_000) ** (1 / 3) / np.linalg.norm(points, axis=1))[:, None]
    points = balls.positions[owner] + radii[owner, None] * points
    axes = glyphs.extents.reshape(3, 3).astype(np.float64)
    np.testing.assert_allclose(glyphs.centers[0], points.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(axes.T @ axes / 5, np.cov(points.T), atol=0.01)
    np.testing.assert_allclose(axes @ axes.T, np.diag(lengths(glyphs)[0] ** 2), atol=1e-6)


@pytest.mark.parametrize("shape", [(1, 0, 0), (1, 1, 0)])
def test_balls_in_a_line_or_a_plane_make_no_flat_ellipsoid(shape):
    positions = np.stack(np.meshgrid(*[np.arange(20.0) if side else [0.0] for side in shape]), axis=-1).reshape(-1, 3)
    balls = meniscus.Balls(0.5 * positions, 1.0)
    glyphs = ellipsoids(balls)
    radius = FIELD.kernel_radii(balls.radii, balls.weights)[0]
    assert np.min(lengths(glyphs)) == pytest.approx(radius, rel=1e-5)


def test_what_an_ellipsoid_carries_is_the_mean_by_mass_and_the_heaviest_of_most():
    balls = meniscus.Balls(
        [(0, 0, 0), (0.5, 0, 0), (1, 0, 0), (1.5, 0, 0)],
        [1.1, 1.0, 1.05, 1.05],
        colors=[(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 1)],
        velocities=np.arange(12).reshape(4, 3),
        sources=[0, 1, 1, 1],
    )
    glyphs = ellipsoids(balls)
    masses = balls.radii.astype(np.float64) ** 3
    np.testing.assert_allclose(glyphs.colors[0], masses @ balls.colors / masses.sum(), rtol=1e-5)
    np.testing.assert_allclose(glyphs.velocities[0], masses @ balls.velocities / masses.sum(), rtol=1e-5)
    # The heaviest ball is of the other source; of two equals the first.
    assert glyphs.balls.tolist() == [2]
    alone = meniscus.Balls(balls.positions, balls.radii)
    assert ellipsoids(alone).balls.tolist() == [0]


def test_liquids_of_balls_without_kernel_spheres_are_counted_and_not_drawn():
    thin = meniscus.Balls([(-0.1, 0, 0), (0, 0, 0), (0.1, 0, 0), (2, 0, 0)], 1.0, [0.2, 0.2, 0.2, 1.0])
    assert number_clusters(thin, FIELD).counts["clusters"] == 2
    glyphs = ellipsoids(thin)
    assert (len(glyphs), glyphs.without_surface, glyphs.balls.tolist()) == (1, 3, [3])
    image = render(thin, "spheres")
    assert image.info.counts["balls_without_surface"] == 3
    assert image.info.counts["glyphs"] == 1


def test_glyphs_are_made_once_for_the_same_balls():
    balls = meniscus.Balls([(0, 0, 0), (3, 0, 0)], 1.0)

    def made(display, field=FIELD):
        return glyphs_of(Request(balls, CAMERA, field, frozenset(), 0, lambda _: None, display=display))

    first = made("spheres")
    assert made("spheres") is first
    assert not made("ellipsoids").are_spheres
    assert made("ellipsoids", meniscus.Field("wyvill", 0.3)) is not made("ellipsoids")


def test_automatic_methods_show_what_is_asked_for():
    balls = meniscus.Balls([(0, 0, 0), (0.5, 0, 0)], 1.0)
    methods = {display: render(balls, display).info.method for display in DISPLAYS}
    assert methods == {"metaballs": "tile_caster", "spheres": "glyph_caster", "ellipsoids": "glyph_caster"}
    with pytest.raises(InputError, match="'tile_caster' does not show spheres: leave the method to Meniscus"):
        render(balls, "spheres", method="tile_caster")
    with pytest.raises(InputError, match="'glyph_caster' does not show metaballs"):
        render(balls, "metaballs", method="glyph_caster")
    with pytest.raises(InputError, match="Unknown display 'dots': choose one of metaballs, spheres, ellipsoids"):
        render(balls, "dots")


def test_what_only_metaballs_have_is_refused_or_noted():
    balls = meniscus.Balls([(0, 0, 0)], 1.0)
    with pytest.raises(InputError, match="Only metaballs have the pass thickness"):
        render(balls, "spheres", passes=("depth", "thickness"))
    looks = [meniscus.Look("material", tracing=tracing) for tracing in (None, Tracing())]
    plain, traced = (render(balls, "ellipsoids", passes=("combined",), look=look) for look in looks)
    assert (plain.info.notes, traced.info.notes) == ((), (UNTRACED,))
    np.testing.assert_array_equal(plain["combined"], traced["combined"])


def test_passes_follow_the_glyph_that_is_seen():
    """A liquid of two balls to the left, a droplet to the right."""
    balls = meniscus.Balls(
        [(-0.8, 0, 0), (-0.4, 0, 0), (0.7, 0, 0)], 0.6, ids=[5, 6, 7], colors=np.eye(3), velocities=np.eye(3), sources=[0, 0, 1]
    )
    names = ("ball_id", "cluster_id", "color", "velocity", "object_index")
    spheres, ellipsoid = (render(balls, display, passes=names) for display in ("spheres", "ellipsoids"))
    assert set(np.unique(spheres["ball_id"])) == {-1, 5, 6, 7}
    assert set(np.unique(ellipsoid["ball_id"])) == {-1, 5, 7}
    for image in (spheres, ellipsoid):
        assert set(np.unique(image["cluster_id"])) == {-1, 1, 2}
        assert set(np.unique(image.objects)) == {-1, 0}
        np.testing.assert_array_equal(image["color"], image["velocity"])
    np.testing.assert_allclose(ellipsoid["color"][ellipsoid["cluster_id"] == 1][0], (0.5, 0.5, 0), atol=1e-6)
    assert set(map(tuple, spheres["color"][spheres.hit])) == set(map(tuple, np.eye(3)))
