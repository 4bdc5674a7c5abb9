"""Equal Interval: what it states of its errors, its settings, and the kernel that no exact method takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import expected, judge
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render.registry import method_infos
from meniscus.gpu_shaders.methods.equal_interval.method import EqualInterval
from meniscus.gpu_shaders.methods.equal_interval.params import hidden_density

MISHIMA = meniscus.Field("mishima", 0.765625)
PLAIN = {"adaptive": False, "samples": 4096}
"""As the paper samples, without its limit."""


def image_of(scene, camera, **settings):
    return meniscus.render(scene.balls, camera, scene.field, method="equal_interval", settings=settings)


def stack(side, layers, spacing=0.5):
    """A square lattice, layer by layer, as in section 6 of the paper: h = 0.61."""
    axis = (np.arange(side) - (side - 1) / 2) * spacing
    x, y, z = np.meshgrid(axis, axis, np.arange(layers) * spacing, indexing="ij")
    return meniscus.Balls(np.stack([x, y, z], -1).reshape(-1, 3), 0.61)


def density(balls, points):
    """Of Mishima's kernel at (N, 3) points."""
    s = np.linalg.norm(points[:, None] - balls.positions.astype(np.float64), axis=-1) / balls.radii
    return (balls.weights * np.square(np.maximum(1 - s, 0))).sum(-1)


def along_rays(balls, field, origins, directions, far, steps):
    """First distance at which the density passes the threshold, on `steps` samples in double precision and then by bisection;
    and the greatest density of each ray."""

    def densities(index, t):
        return density(balls, origins[index] + np.multiply.outer(t, directions[index]))

    first, highest = np.full(len(origins), np.inf), np.zeros(len(origins))
    t = np.linspace(0, far, steps)
    for index in range(len(origins)):
        above = densities(index, t)
        highest[index] = above.max()
        if highest[index] < field.threshold:
            continue
        behind = np.argmax(above >= field.threshold)
        low, high = t[max(behind - 1, 0)], t[behind]
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if densities(index, np.array([middle]))[0] >= field.threshold else (middle, high)
        first[index] = high
    return first, highest


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_mishimas_kernel_against_dense_samples_in_double_precision(projection):
    random = np.random.default_rng(11)
    weights = np.array([1, 1, 1.5, 2, -0.5, 1, 1, 3, 1, 1, 1, 1])
    balls = meniscus.Balls(random.uniform(-0.7, 0.7, (12, 3)), random.uniform(0.5, 1.1, 12), weights)
    scene = Scene(balls, field=MISHIMA, view_height=1.8)
    camera = replace(scene.camera(projection), width=32, height=24)
    image = meniscus.render(balls, camera, MISHIMA)
    assert image.info.method == "equal_interval", "the only one that takes the kernel"
    view_origins, view_directions = (array.reshape(-1, 3) for array in camera.view_rays())
    stretch = np.linalg.norm(view_directions, axis=1)
    rotation = camera.world_from_view[:3, :3]
    origins = view_origins @ rotation.T + camera.eye
    want, highest = along_rays(balls, MISHIMA, origins, view_directions / stretch[:, None] @ rotation.T, 7.0, 1401)
    t = np.where(image.hit.ravel(), image["depth"].ravel() * stretch, np.inf)
    decidable = np.abs(highest - MISHIMA.threshold) > 5e-3
    both = np.isfinite(t) & np.isfinite(want)
    assert both.sum() > 150
    assert np.count_nonzero(decidable & (np.isfinite(t) != np.isfinite(want))) <= 1
    assert np.quantile(np.abs(t[both] - want[both]), 0.998) < 1e-3
    # Against the gradient of the sum, by its differences.
    points = origins[both] + want[both, None] * (view_directions / stretch[:, None] @ rotation.T)[both]
    steps = np.eye(3) * 1e-5
    slopes = np.stack([density(balls, points + step) - density(balls, points - step) for step in steps], -1)
    normals = -slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
    tilt = np.einsum("ij,ij->i", normals, image["normal"].reshape(-1, 3)[both])
    assert np.quantile(tilt, 0.02) > np.cos(np.radians(1))


def test_a_lone_ball_of_mishimas_kernel_is_a_sphere_of_its_isolated_radius():
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=0.4, width=101, height=101)
    image = meniscus.render(meniscus.Balls([[0, 0, 0]], 0.61), camera, MISHIMA)
    radius = 0.61 * (1 - 0.765625)
    x, z = np.meshgrid(*[(np.arange(101) - 50) * 0.4 / 101] * 2)
    apart = np.hypot(x, z)
    np.testing.assert_array_equal(image.hit[np.abs(apart - radius) > 1e-4], apart[np.abs(apart - radius) > 1e-4] < radius)
    want = 4 - np.sqrt(np.maximum(radius**2 - apart**2, 0))
    inner = apart < 0.99 * radius
    np.testing.assert_allclose(image["depth"][inner], want[inner], atol=3e-4)
    outward = np.stack([x, want - 4, z], -1)[inner] / radius
    np.testing.assert_allclose(image["normal"][inner], outward, atol=3e-3)


def test_a_table_of_densities_draws_as_the_kernel_that_it_is_of():
    scene = SCENES["negative_weights"]()
    camera = scene.camera("perspective")
    kernel = scene.field.density_kernel
    table = meniscus.DensityProfile(kernel.value(1 - np.linspace(0, 1, 1024) ** 2))
    named, tabled = (
        meniscus.render(scene.balls, camera, meniscus.Field(own, scene.field.isovalue), method="equal_interval")
        for own in (scene.field.kernel, table)
    )
    assert np.count_nonzero(named.hit != tabled.hit) <= 3
    both = named.hit & tabled.hit
    np.testing.assert_allclose(tabled["depth"][both], named["depth"][both], atol=2e-3)
    assert np.mean(np.abs(tabled["normal"] - named["normal"]).max(-1)[both] > 0.02) < 2e-3
    # Another table of another length, by the same programs.
    blunt = meniscus.render(scene.balls, camera, meniscus.Field(meniscus.DensityProfile([1, 1, 0]), 0.2))
    assert blunt.info.method == "equal_interval"
    assert blunt.hit.sum() > tabled.hit.sum()


def errors(scene, camera, **settings):
    """|dt| / R of the pixels that look straight at a ball's middle part."""
    image = image_of(scene, camera, **settings)
    want = expected(scene.balls, scene.field, camera)
    t = image["depth"].ravel() * want.stretch
    facing = np.isfinite(want.t) & image.hit.ravel() & (np.einsum("ij,ij->i", want.normals, want.directions) < -0.7)
    return np.abs(t[facing] - want.t[facing]) / want.radius[facing]


@pytest.mark.parametrize(("refinements", "order"), [(0, 1), (1, 2)])
def test_the_surface_converges_with_the_interval(refinements, order):
    scene = SCENES["ten_balls"]()
    camera = replace(scene.camera("perspective"), width=32, height=24)
    intervals = [1 / 16, 1 / 32, 1 / 64]
    means = [np.mean(errors(scene, camera, **PLAIN, interval=interval, refinements=refinements)) for interval in intervals]
    orders = np.log2(np.array(means[:-1]) / means[1:])
    assert np.all(np.abs(orders - order) < 0.25), (means, orders)


def test_each_further_refinement_leaves_less():
    scene = SCENES["ten_balls"]()
    camera = replace(scene.camera("perspective"), width=32, height=24)
    means = [np.mean(errors(scene, camera, **PLAIN, refinements=refinements)) for refinements in (0, 1, 2, 3)]
    assert np.all(np.array(means[1:]) < np.array(means[:-1]) / 8), means


def rim(interval):
    """Rays through one ball, ever nearer to its surface's rim: how far the density rises above the isovalue, and who hits."""
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=5e-3, width=600, height=1)
    field = meniscus.Field()
    edge = field.kernel_radii(np.ones(1), np.ones(1))[0]
    # The row of pixels is around the rim; it is 3 units long.
    moved = meniscus.Balls([[edge, 0, 0]], 1.0)
    image = meniscus.render(moved, camera, field, method="equal_interval", settings={**PLAIN, "interval": interval})
    x = (np.arange(600) - 299.5) * 5e-3
    peak = field.density_kernel.value(1 - (x - edge) ** 2)
    return peak - field.threshold, image.hit[0]


@pytest.mark.parametrize("interval", [0.3, 0.2])
def test_what_is_missed_is_below_the_stated_bound(interval):
    # The ball alone has a radius of 0.7: half of that is more than these intervals.
    above, hit = rim(interval)
    bound = hidden_density(meniscus.Field(), 1, interval)
    assert np.all(hit[above > bound])
    assert not hit[above < -1e-5].any()
    missed = (above > 1e-4) & ~hit
    assert missed.any(), "at such intervals something is missed"
    assert above[missed].max() > 0.02 * bound, "the bound is not far from the truth"


def test_adaptive_rays_look_closer_and_miss_nothing_of_a_rim():
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2, width=201, height=201)
    scene = Scene(meniscus.Balls([[0, 0, 0]], 1.0))
    want = np.isfinite(expected(scene.balls, scene.field, camera).t).reshape(201, 201)
    missed = {
        is_adaptive: np.count_nonzero(want != image_of(scene, camera, adaptive=is_adaptive).hit)
        for is_adaptive in (False, True)
    }
    assert missed[True] == 0
    assert missed[False] > 20


def test_holes_close_with_more_samples_and_are_counted():
    # As figure 12 of the paper: rays that graze the layers need many samples.
    scene = Scene(stack(12, 4), (0.3, -12, 1.9), (0, 0, 0.75), view_height=3, field=MISHIMA)
    camera = replace(scene.camera("perspective"), width=64, height=48)
    whole = image_of(scene, camera)
    assert whole.info.counts["unfinished"] == 0
    images = [image_of(scene, camera, adaptive=False, samples=samples) for samples in (8, 16, 32, 64, 128)]
    unfinished = [image.info.counts["unfinished"] for image in images]
    holes = [np.count_nonzero(whole.hit & ~image.hit) for image in images]
    assert unfinished == sorted(unfinished, reverse=True)
    assert holes == sorted(holes, reverse=True)
    assert unfinished[0] > 100
    assert unfinished[-1] == 0
    assert holes[0] > 50
    assert holes[-1] <= 0.001 * whole.hit.size
    # What is not finished is shown as background, and nothing else is.
    assert all(hole <= count + 3 for hole, count in zip(holes, unfinished, strict=True))
    assert [image.info.counts["samples"] for image in images] == sorted(image.info.counts["samples"] for image in images)


def test_the_limit_counts_samples_exactly_to_its_last():
    # Seven samples: the second four are cut after three.
    scene = SCENES["one_ball"]()
    camera = scene.camera("perspective")
    hits = [image_of(scene, camera, adaptive=False, samples=samples).hit.sum() for samples in (4, 5, 6, 7, 8)]
    assert hits == sorted(hits)
    assert len(set(hits)) > 3


def test_radii_over_three_orders_of_magnitude_side_by_side():
    random = np.random.default_rng(5)
    radii = 10 ** random.uniform(-3, 0, 400)
    # Small ones in front of, and within, the reach of great ones, and seen as large.
    positions = random.uniform(-1, 1, (400, 3)) * np.array([0.5, 0.5, 0.5]) * radii[:, None] ** 0.5
    scene = Scene(meniscus.Balls(positions, radii), (0.1, -1.5, 0.2), (0, 0, 0), view_height=0.9)
    for projection in ("perspective", "orthographic"):
        camera = scene.camera(projection)
        judge(image_of(scene, camera), scene, camera)


@pytest.mark.parametrize("name", ["ten_balls", "negative_weights", "eye_inside_fluid", "lattice_with_droplets"])
def test_culling_does_not_change_the_image(opengl, monkeypatch, name):
    scene = SCENES[name]()
    camera = scene.camera("perspective")
    culled = image_of(scene, camera)
    monkeypatch.setitem(opengl._kept, EqualInterval, EqualInterval(opengl, ball_culling=False))
    whole = image_of(scene, camera)
    np.testing.assert_array_equal(culled.hit, whole.hit)
    np.testing.assert_array_equal(culled["depth"], whole["depth"])
    np.testing.assert_array_equal(culled["normal"], whole["normal"])


def test_an_image_does_not_depend_on_the_one_before():
    scene, other = SCENES["ball_behind_ball"](), SCENES["tangent_rays"]()
    camera = scene.camera("perspective")
    first = image_of(scene, camera)
    image_of(other, other.camera("orthographic"))
    np.testing.assert_array_equal(image_of(scene, camera)["depth"], first["depth"])


def test_parts_give_the_same_image(pretend_limits):
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = image_of(scene, camera)
    pretend_limits(texture_size=4096, viewport_size=40)
    parts = image_of(scene, camera)
    assert np.count_nonzero(parts.hit != whole.hit) <= 1
    both = parts.hit & whole.hit
    np.testing.assert_allclose(parts["depth"][both], whole["depth"][both], atol=1e-3)


def test_velocities_and_balls_are_those_of_the_exact_methods():
    scene = SCENES["ten_balls"]()
    velocities = np.random.default_rng(3).normal(size=(len(scene.balls), 3))
    balls = meniscus.Balls(scene.balls.positions, scene.balls.radii, velocities=velocities, ids=np.arange(10) + 2**25)
    camera = scene.camera("perspective")
    passes = ("velocity", "ball_id")
    ours, exact = (
        meniscus.render(balls, camera, scene.field, method=method, passes=passes)
        for method in ("equal_interval", "tile_caster")
    )
    both = ours.hit & exact.hit
    off = np.abs(ours["velocity"] - exact["velocity"]).max(-1)[both]
    assert np.mean(off > 1e-3) < 2e-3
    assert np.mean(ours["ball_id"][both] != exact["ball_id"][both]) < 2e-3
    np.testing.assert_array_equal(ours["ball_id"][~ours.hit], exact["ball_id"][~exact.hit][0])


@pytest.mark.parametrize("weight", [1e6, 1e30, 3e38])
def test_sums_of_great_weights_do_not_spoil_the_image(weight):
    # Three of the greatest are more than a float holds. The surface is all but the influence sphere.
    balls = meniscus.Balls(np.zeros((3, 3)), 1.0, weights=weight)
    camera = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2.5, width=41, height=41)
    image = meniscus.render(balls, camera, meniscus.Field(), method="equal_interval")
    x, z = np.meshgrid(*[(np.arange(41) - 20) * 2.5 / 41] * 2)
    apart = np.hypot(x, z)
    assert image.hit[apart < 0.95].all()
    assert not image.hit[apart > 1].any()
    inner = apart < 0.9
    np.testing.assert_allclose(image["depth"][inner], (4 - np.sqrt(np.maximum(1 - apart**2, 0)))[inner], atol=0.02)
    assert np.isfinite(image["normal"]).all()
    np.testing.assert_allclose(np.linalg.norm(image["normal"][inner], axis=-1), 1, atol=1e-5)


@pytest.mark.parametrize(
    "settings",
    [{"interval": 0.0}, {"interval": -0.1}, {"interval": float("nan")}, {"samples": 1}, {"refinements": -1}, {"adaptive": 2}],
)
def test_unusable_settings_are_refused(settings):
    scene = SCENES["one_ball"]()
    with pytest.raises(InputError, match=next(iter(settings))):
        image_of(scene, scene.camera("perspective"), **settings)


@pytest.mark.parametrize("method", [info.name for info in method_infos() if not info.any_kernel])
def test_methods_that_need_polynomials_refuse_the_kernel(method):
    scene = SCENES["one_ball"]()
    with pytest.raises(InputError, match="no polynomial; choose the method Equal Interval"):
        meniscus.render(scene.balls, scene.camera("perspective"), MISHIMA, method=method)


def test_passes_that_need_polynomials_refuse_the_kernel():
    scene = SCENES["one_ball"]()
    with pytest.raises(InputError, match="thickness pass"):
        meniscus.render(scene.balls, scene.camera("perspective"), MISHIMA, passes=("depth", "thickness"))
