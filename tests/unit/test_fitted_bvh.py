"""The fitted BVH against the oracle: any rays, any weights, any place."""

from __future__ import annotations

import time

import numpy as np
import pytest
from render.scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.fluid.kernels import POLYNOMIAL_KERNELS
from meniscus.addon.render.native import load

# A ray whose density has an extremum this close to the isovalue cannot be decided in single precision.
UNDECIDABLE = 1e-4

VARIANTS = {
    "fitted": {},
    "not fitted": {"fits": False},
    "not tightened": {"tightens": False},
    "not discarded": {"discards": False},
    "not proven": {"proves": False},
    "bare": {"fits": False, "tightens": False, "discards": False, "proves": False},
    "overlapping": {"hierarchy": "overlapping"},
    "bare overlapping": {"hierarchy": "overlapping", "tightens": False, "discards": False, "proves": False},
}


def camera_rays(scene: Scene, projection: str = "perspective"):
    camera = scene.camera(projection)
    origins, directions = (array.reshape(-1, 3) for array in camera.view_rays())
    rotation = camera.world_from_view[:3, :3]
    return origins @ rotation.T + camera.eye, directions @ rotation.T


def random_rays(scene: Scene, count: int, seed: int):
    """Rays that begin in and around the fluid, inside or out, and go anywhere."""
    random = np.random.default_rng(seed)
    balls = scene.balls
    ball = random.integers(len(balls), size=count)
    offset = random.normal(size=(count, 3)) * balls.radii[ball, None]
    return balls.positions[ball].astype(np.float64) + offset, random.normal(size=(count, 3))


def judge(balls, field, bvh, origins, directions):
    """Hits as the oracle's, within the bounds that every exact method keeps. Gives the hits."""
    hits = bvh.first_hit(origins, directions)
    t, normals = meniscus.oracle.cast(balls, field, origins, directions)
    both = np.isfinite(t) & np.isfinite(hits.t)
    radius = np.where(hits.balls >= 0, balls.radii[hits.balls], 1.0)
    error = np.where(both, np.abs(np.where(both, hits.t, 0) - np.where(both, t, 0)) / radius, 0.0)
    suspect = (np.isfinite(t) != np.isfinite(hits.t)) | (error > 1e-3)
    undecidable = np.zeros(len(t), bool)
    undecidable[suspect] = is_undecidable(balls, field, origins[suspect], directions[suspect], radius[suspect])
    wrong = np.flatnonzero(suspect & ~undecidable)
    assert not len(wrong), f"{len(wrong)} wrong rays, such as {wrong[0]}: t = {hits.t[wrong[0]]}, oracle {t[wrong[0]]}"
    assert undecidable.sum() <= 0.002 * len(t) + 2
    both &= ~undecidable
    if both.any():
        assert np.sqrt(np.mean(error[both] ** 2)) <= 1e-4
        cosine = np.einsum("ij,ij->i", hits.normals[both], normals[both])
        assert np.degrees(np.arccos(np.clip(cosine.min(), -1, 1))) <= 0.5
    assert np.array_equal(hits.balls < 0, np.isinf(hits.t))
    assert not hits.normals[hits.balls < 0].any()
    return hits


def is_undecidable(balls, field, origins, directions, radius):
    """Whether an isovalue that differs by next to nothing changes the hit."""
    t = [
        meniscus.oracle.cast(balls, meniscus.Field(field.kernel, field.isovalue + shift), origins, directions)[0]
        for shift in (-UNDECIDABLE, UNDECIDABLE)
    ]
    same = np.isfinite(t[0]) & np.isfinite(t[1])
    apart = np.abs(np.where(same, t[0], 0) - np.where(same, t[1], 0)) > 1e-3 * radius
    return apart | (np.isfinite(t[0]) != np.isfinite(t[1]))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("name", SCENES)
def test_camera_rays_match_the_oracle(name, projection):
    scene = SCENES[name]()
    origins, directions = camera_rays(scene, projection)
    hits = judge(scene.balls, scene.field, meniscus.FittedBvh(scene.balls, scene.field), origins, directions)
    assert np.isfinite(hits.t).sum() > 100


@pytest.mark.parametrize("name", SCENES)
def test_random_rays_match_the_oracle(name):
    scene = SCENES[name]()
    origins, directions = random_rays(scene, 4000, 1)
    bvh = meniscus.FittedBvh(scene.balls, scene.field)
    hits = judge(scene.balls, scene.field, bvh, origins, directions)
    assert np.array_equal(bvh.any_hit(origins, directions), np.isfinite(hits.t))
    assert np.isfinite(hits.t).sum() > 100


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", ["random_5000", "lattice_with_droplets", "negative_weights", "kernel_power_1"])
def test_every_variant_of_the_tree_gives_the_same_surface(name, variant):
    scene = SCENES[name]()
    origins, directions = random_rays(scene, 2000, 2)
    bvh = meniscus.FittedBvh(scene.balls, scene.field, **VARIANTS[variant])
    hits = judge(scene.balls, scene.field, bvh, origins, directions)
    assert np.array_equal(bvh.any_hit(origins, directions), np.isfinite(hits.t))


def scene_of_any_sort(random):
    """Up to 2000 balls, sparse to dense, of radii over up to three orders of magnitude, some carving, some on a lattice."""
    count = int(10 ** random.uniform(0, 3.3))
    radii = 10 ** random.uniform(-random.choice([0, 0.5, 1.5, 3]), 0, count)
    weights = random.uniform(0.1, 2, count) * random.choice([1, 1, random.choice([1, -1])], count)
    balls_a_volume = 10 ** random.uniform(-1, 1.5)
    positions = random.uniform(-1, 1, (count, 3)) * (count / balls_a_volume * np.mean(radii**3)) ** (1 / 3)
    if random.random() < 0.3:
        positions, radii = np.round(positions * 8) / 8, np.maximum(np.round(radii * 8) / 8, 0.125)
    shift = random.choice([0, 0, 0, 1e3, 1e5]) * random.normal(size=3)
    field = meniscus.Field(str(random.choice(list(POLYNOMIAL_KERNELS))), float(10 ** random.uniform(-1.5, 0.5)))
    return Scene(meniscus.Balls(positions + shift, radii, weights), field=field)


def rays_of_any_sort(scene, random):
    """From in and around the fluid or from far away, some along the axes and through round coordinates."""
    origins, directions = random_rays(scene, 500, int(random.integers(1000)))
    if random.random() < 0.3:
        origins -= 10 ** random.uniform(0, 5) * directions
    if random.random() < 0.3:
        directions = np.eye(3)[random.integers(3, size=500)] * random.choice([1, -1], (500, 1))
        origins = np.where(random.random((500, 1)) < 0.5, np.round(origins * 8) / 8, origins)
    return origins, directions


@pytest.mark.parametrize("variant", VARIANTS)
def test_scenes_of_any_sort_match_the_oracle(variant):
    found = 0
    for seed in range(40):
        random = np.random.default_rng([list(VARIANTS).index(variant), seed])
        scene = scene_of_any_sort(random)
        origins, directions = rays_of_any_sort(scene, random)
        bvh = meniscus.FittedBvh(scene.balls, scene.field, **VARIANTS[variant])
        hits = judge(scene.balls, scene.field, bvh, origins, directions)
        assert np.array_equal(bvh.any_hit(origins, directions), np.isfinite(hits.t))
        found += np.isfinite(hits.t).sum()
    assert found > 0.2 * 40 * 500


@pytest.mark.parametrize("shift", [(1e5, -1e5, 1e5), (3e4, 3e4, 0), (1e6, 1e6, 1e6)])
def test_far_from_the_origin_nothing_is_lost(shift):
    grid = np.round(np.random.default_rng(4).uniform(-4, 4, (400, 3)) * 8) / 8
    near, far = (meniscus.Balls((grid + offset).astype(np.float32), 0.75) for offset in (np.zeros(3), np.array(shift)))
    assert np.array_equal(far.positions - np.array(shift, np.float32), near.positions)
    origins, directions = random_rays(Scene(near), 3000, 5)
    origins = np.round(origins * 1024) / 1024
    field = meniscus.Field()
    hits = judge(far, field, meniscus.FittedBvh(far, field), origins + shift, directions)
    expected = meniscus.FittedBvh(near, field).first_hit(origins, directions)
    assert np.array_equal(np.isfinite(hits.t), np.isfinite(expected.t))
    np.testing.assert_allclose(hits.t, expected.t, rtol=0, atol=1e-5)


def test_small_balls_in_a_large_scene_lose_nothing():
    # Two drops of balls of a hundredth, a kilometre apart: no origin is near both.
    offsets = np.round(np.random.default_rng(8).uniform(-0.03, 0.03, (60, 3)) * 2**14) / 2**14
    balls = meniscus.Balls(np.concatenate([offsets + [-500, 30, 700], offsets + [500, -30, 700]]), 0.0125)
    origins, directions = random_rays(Scene(balls), 3000, 9)
    hits = judge(balls, meniscus.Field(), meniscus.FittedBvh(balls, meniscus.Field()), origins, directions)
    assert np.isfinite(hits.t).sum() > 500


def test_a_pocket_in_the_fluid_is_not_taken_for_fluid():
    # On a cubic lattice the field is least in the middles of the cells. An isovalue just above that makes a pocket in each.
    axis = np.arange(-10.0, 11.0)
    balls = meniscus.Balls(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3), 1.0)
    corner = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    least = POLYNOMIAL_KERNELS["quartic"].value(1 - (corner**2).sum(1)).sum()
    random = np.random.default_rng(10)
    origins = np.floor(random.uniform(-5, 5, (2000, 3))) + 0.5 + random.normal(0, 0.1, (2000, 3))
    directions = random.normal(size=(2000, 3))
    for share, has_pockets in ((1.02, True), (0.98, False)):
        field = meniscus.Field("quartic", least * share)
        bvh = meniscus.FittedBvh(balls, field)
        hits = judge(balls, field, bvh, origins, directions)
        assert np.all(hits.t[np.isfinite(hits.t)] > 4) != has_pockets


@pytest.mark.parametrize("radius", [0.8, 3.0])
def test_bubbles_that_balls_carve_are_not_taken_for_fluid(radius):
    axis = np.arange(-10.0, 11.0)
    lattice = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    random = np.random.default_rng(11)
    bubbles = random.uniform(-6, 6, (40 if radius < 1 else 3, 3))
    balls = meniscus.Balls(
        np.concatenate([lattice, bubbles]),
        np.repeat([2.0, radius], [len(lattice), len(bubbles)]),
        np.repeat([1.0, -20.0], [len(lattice), len(bubbles)]),
    )
    origins = bubbles[random.integers(len(bubbles), size=2000)] + random.normal(0, 0.5 * radius, (2000, 3))
    field = meniscus.Field("wyvill", 0.4)
    hits = judge(balls, field, meniscus.FittedBvh(balls, field), origins, random.normal(size=(2000, 3)))
    assert np.mean(hits.t < 2 * radius) > 0.3


def test_rays_from_far_away_hit_as_those_from_nearby():
    scene = SCENES["random_5000"]()
    origins, directions = camera_rays(scene)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bvh = meniscus.FittedBvh(scene.balls, scene.field)
    near, far = bvh.first_hit(origins, directions), bvh.first_hit(origins - 1e6 * directions, directions)
    differ = np.isfinite(near.t) != np.isfinite(far.t)
    assert differ.mean() < 1e-3
    hit = np.isfinite(near.t) & ~differ
    assert np.percentile(np.abs(far.t[hit] - 1e6 - near.t[hit]), 99.9) < 1e-5


def test_limits_are_respected():
    scene = SCENES["random_5000"]()
    origins, directions = camera_rays(scene)
    directions *= np.random.default_rng(6).uniform(0.1, 10, (len(directions), 1))
    bvh = meniscus.FittedBvh(scene.balls, scene.field)
    t = bvh.first_hit(origins, directions).t
    hit = np.isfinite(t)
    assert hit.sum() > 1000
    # The surface just before t_max is seen, just behind it is not.
    for share, is_seen in ((0.999, False), (1.001, True)):
        limited = bvh.first_hit(origins[hit], directions[hit], 0, t[hit] * share)
        assert np.isfinite(limited.t).all() == is_seen
        assert np.isfinite(limited.t).any() == is_seen
        assert np.array_equal(bvh.any_hit(origins[hit], directions[hit], 0, t[hit] * share), np.isfinite(limited.t))
    # Behind the first hit a ray begins inside: what it sees from there is what a ray sees that starts there.
    unit = directions[hit] / np.linalg.norm(directions[hit], axis=1, keepdims=True)
    start = t[hit] + 0.01
    behind = bvh.first_hit(origins[hit], directions[hit], start)
    moved = bvh.first_hit(origins[hit] + start[:, None] * unit, unit)
    np.testing.assert_allclose(behind.t, moved.t + start, atol=1e-5)
    assert np.all(behind.t > start)
    # Also where the interval is behind the origin.
    back = bvh.first_hit(origins[hit] + 100 * unit, unit, -200.0, 0.0)
    np.testing.assert_allclose(back.t + 100, t[hit], atol=1e-4)


def test_nothing_lies_between_limits_that_are_swapped():
    bvh = meniscus.FittedBvh(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field())
    assert not bvh.any_hit([[0, -4, 0]], ALONG_Y, 5.0, 1.0).any()
    assert bvh.any_hit([[0, -4, 0]], ALONG_Y, 1.0, 5.0).all()


ALONG_Y = [[0.0, 1.0, 0.0]]


def test_rays_along_the_axes_and_in_the_planes_of_boxes():
    # Splits of a lattice fall on round numbers, and so do these rays; some components are minus zero.
    axis = np.arange(8) * 0.25
    balls = meniscus.Balls(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3), 0.25)
    places = np.arange(-2, 17) * 0.125
    u, v = (grid.ravel() for grid in np.meshgrid(places, places))
    for axis_number in range(3):
        for sign in (1.0, -1.0):
            direction = np.full((len(u), 3), -0.0)
            direction[:, axis_number] = sign
            origins = np.insert(np.stack([u, v], 1), axis_number, 0.875 - 3 * sign, axis=1)
            for isovalue in (0.3, 0.7):
                field = meniscus.Field("quartic", isovalue)
                judge(balls, field, meniscus.FittedBvh(balls, field), origins, direction)


def test_no_balls_and_no_rays():
    none = meniscus.FittedBvh(meniscus.Balls(np.zeros((0, 3)), np.zeros(0)), meniscus.Field())
    hits = none.first_hit([[0, 0, 0]], ALONG_Y)
    assert np.isinf(hits.t).all()
    assert hits.balls[0] == -1
    assert not none.any_hit([[0, 0, 0]], ALONG_Y).any()
    some = meniscus.FittedBvh(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field())
    assert some.first_hit(np.zeros((0, 3)), np.zeros((0, 3))).normals.shape == (0, 3)
    assert some.any_hit(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    assert some.counts(np.zeros((0, 3)), np.zeros((0, 3))).searches == 0


def test_balls_that_only_carve_or_are_too_thin_make_no_surface():
    for weights in (-1.0, 0.01):
        bvh = meniscus.FittedBvh(meniscus.Balls([[0, 0, 0], [0.2, 0, 0]], 1.0, weights), meniscus.Field())
        assert not bvh.any_hit([[0, -4, 0]], ALONG_Y).any()


def test_the_ball_with_the_greatest_share_is_named():
    balls = meniscus.Balls([[0, 0, 0], [0.9, 0, 0], [0, 0, 30]], 1.0, weights=[1, 1, 1])
    hits = meniscus.FittedBvh(balls, meniscus.Field()).first_hit([[-0.1, -4, 0], [1, -4, 0], [0, -4, 30]], ALONG_Y * 3)
    assert list(hits.balls) == [0, 1, 2]


def test_unusable_rays_are_named():
    bvh = meniscus.FittedBvh(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field())
    origins, directions = np.zeros((5, 3)), np.ones((5, 3))
    with pytest.raises(InputError, match=r"origins must be .* shape \(N, 3\)"):
        bvh.first_hit(np.zeros((5, 2)), directions)
    with pytest.raises(InputError, match="directions must have a row for each of the 5 origins, not 4"):
        bvh.any_hit(origins, directions[:4])
    with pytest.raises(InputError, match="t_max must be one number, or one for each of the 5 rays, not 3"):
        bvh.any_hit(origins, directions, 0.0, np.ones(3))
    with pytest.raises(InputError, match="origins must be an array of numbers"):
        bvh.first_hit([["a", "b", "c"]], ALONG_Y)
    for bad in (0.0, np.nan, np.inf):
        broken = directions.copy()
        broken[3] = bad
        for cast in (bvh.first_hit, bvh.any_hit, bvh.counts):
            with pytest.raises(InputError, match=r"Ray 3 .* no direction zero"):
                cast(origins, broken)
    for limits in ((np.nan, 1.0), (0.0, np.nan), (np.inf, np.inf)):
        with pytest.raises(InputError, match="t_min"):
            bvh.first_hit(origins, directions, *limits)


def test_native_arrays_are_checked():
    native = load().FittedBvh(np.zeros((1, 3), np.float32), np.ones(1, np.float32), np.ones(1, np.float32), [0, 0, 1], 0.2)
    rays, limit = np.ones((4, 3)), np.zeros(1)
    with pytest.raises(ValueError, match=r"origins .* of float32"):
        native.first_hit(rays.astype(np.float32), rays, limit, limit)
    with pytest.raises(ValueError, match=r"directions .* strides"):
        native.any_hit(rays, np.ones((8, 3))[::2], limit, limit)
    with pytest.raises(ValueError, match="isovalue"):
        load().FittedBvh(np.zeros((1, 3), np.float32), np.ones(1, np.float32), np.ones(1, np.float32), [0, 0, 1], 0.0)
    with pytest.raises(ValueError, match="radii"):
        load().FittedBvh(np.zeros((1, 3), np.float32), np.zeros(1, np.float32), np.ones(1, np.float32), [0, 0, 1], 0.2)


def test_unknown_hierarchy_is_refused():
    with pytest.raises(InputError, match="'octree'"):
        meniscus.FittedBvh(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field(), hierarchy="octree")


class GivenUpError(Exception):
    pass


def give_up(share_done):
    assert 0 <= share_done <= 1
    raise GivenUpError


def test_work_can_be_cancelled():
    random = np.random.default_rng(7)
    balls = meniscus.Balls(random.random((300_000, 3)), 0.03)
    begin = time.perf_counter()
    bvh = meniscus.FittedBvh(balls, meniscus.Field())
    with pytest.raises(GivenUpError):
        meniscus.FittedBvh(balls, meniscus.Field(), watch=give_up)
    assert time.perf_counter() - begin < 60
    origins, directions = random.random((2_000_000, 3)), random.normal(size=(2_000_000, 3))
    for cast in (bvh.first_hit, bvh.any_hit):
        with pytest.raises(GivenUpError):
            cast(origins, directions, watch=give_up)


def walk(arrays):
    """Every node of the tree: box, kind or children, from the arrays that a GPU gets."""
    whole = arrays.nodes.view(np.uint32)
    for index in range(len(arrays.nodes)):
        low, high = arrays.nodes[index, :3], arrays.nodes[index, 4:7]
        yield index, low, high, int(whole[index, 3]), int(whole[index, 7])


INNER, FULL, NO_BALL = 2**32 - 1, 2**32 - 2, 2**32 - 1


@pytest.mark.parametrize("name", ["random_5000", "lattice_with_droplets", "negative_weights", "far_from_origin"])
def test_arrays_hold_the_field_near_the_surface(name):
    """A program that knows only the arrays finds the surface: each point of it lies in one leaf, whose balls give T there."""
    scene = SCENES[name]()
    origins, directions = camera_rays(scene)
    bvh = meniscus.FittedBvh(scene.balls, scene.field)
    t = meniscus.oracle.cast(scene.balls, scene.field, origins, directions)[0]
    hit = np.flatnonzero(np.isfinite(t))[::7]
    unit = directions[hit] / np.linalg.norm(directions[hit], axis=1, keepdims=True)
    arrays = bvh.arrays()
    points = origins[hit] + t[hit, None] * unit - arrays.origin
    leaves = [(low, high, link, count) for _, low, high, link, count in walk(arrays) if count not in (0, INNER, FULL)]
    inside = np.array([np.all((low <= points) & (points <= high), axis=1) for low, high, _, _ in leaves])
    assert np.all(inside.sum(axis=0) >= 1)
    assert np.mean(inside.sum(axis=0) == 1) > 0.99
    for column, point in zip(inside.T[:200], points[:200], strict=False):
        _, _, link, count = leaves[int(np.argmax(column))]
        assert link % 16 == 0
        ids = arrays.ids[link : link + count]
        centers, radii = arrays.balls[ids, :3].astype(np.float64), arrays.balls[ids, 3].astype(np.float64)
        x = 1 - ((point - centers) ** 2).sum(1) / radii**2
        density = (arrays.weights[ids] * scene.field.density_kernel.value(x)).sum()
        assert density == pytest.approx(scene.field.isovalue, abs=1e-5)


def test_children_lie_in_their_parents_and_do_not_overlap():
    arrays = meniscus.FittedBvh(*scene_of("random_5000")).arrays()
    nodes = {index: (low, high, link, count) for index, low, high, link, count in walk(arrays)}
    inner = [(index, node) for index, node in nodes.items() if node[3] == INNER]
    assert len(inner) > 300
    for index, (low, high, right, _) in inner:
        (left_low, left_high, _, left), (right_low, right_high, _, other) = nodes[index + 1], nodes[right]
        for child_low, child_high, count in ((left_low, left_high, left), (right_low, right_high, other)):
            assert count == 0 or (np.all(low <= child_low) and np.all(child_high <= high))
        assert np.any(left_high <= right_low) or np.any(right_high <= left_low)
    leaves = [node for node in nodes.values() if node[3] not in (0, INNER, FULL)]
    padding = np.ones(len(arrays.ids), bool)
    for _, _, link, count in leaves:
        padding[link : link + count] = False
    assert np.all(arrays.ids[padding] == NO_BALL)
    assert np.all(arrays.ids[~padding] < len(arrays.balls))


def scene_of(name):
    scene = SCENES[name]()
    return scene.balls, scene.field


@pytest.mark.parametrize("name", ["lattice_with_droplets", "random_5000"])
def test_refinements_save_work(name):
    rays = camera_rays(SCENES[name]())
    counts = {variant: meniscus.FittedBvh(*scene_of(name), **options).counts(*rays) for variant, options in VARIANTS.items()}
    fitted = counts["fitted"]
    assert fitted.traversals >= 1
    # Table 3: an overlapping tree searches more leaves and far more balls.
    assert fitted.searches < counts["bare"].searches
    assert counts["overlapping"].searches > 1.2 * fitted.searches
    assert counts["overlapping"].balls > 2 * fitted.balls
    # Table 4.
    assert fitted.searches < counts["not fitted"].searches
    # Table 5; what pays depends on the scene.
    if name == "random_5000":
        assert fitted.searches < counts["not tightened"].searches
    else:
        assert fitted.balls < counts["not discarded"].balls
        assert fitted.searches < counts["not proven"].searches
