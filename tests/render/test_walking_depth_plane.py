"""What is special about Walking Depth Plane: how its error shrinks, small balls among large ones, and how its walk ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import compare, expected
from scenes import SCENES, Scene

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.gpu_shaders.methods.walking_depth_plane import method as walking
from meniscus.gpu_shaders.methods.walking_depth_plane.budget import FIRST_GUESS, Budget, Experience

METHOD = "walking_depth_plane"


def render(scene, camera=None, **settings):
    camera = camera or scene.camera("perspective")
    return meniscus.render(scene.balls, camera, scene.field, method=METHOD, settings=settings)


class Clock:
    """A clock on which a pass takes a millisecond: it moves on whenever it is read, which the walk does twice a pass."""

    def __init__(self, seconds=0.0005):
        self.now, self.seconds = 0.0, seconds

    def __call__(self):
        self.now += self.seconds
        return self.now


@pytest.fixture
def clock(monkeypatch, opengl):
    """Rules over the time of the method."""
    fake = Clock()
    monkeypatch.setattr(opengl.kept(walking.WalkingDepthPlane), "_clock", fake)
    monkeypatch.setattr(opengl.kept(walking.WalkingDepthPlane), "_experience", Experience())
    return fake


def met_pixels(scene, camera):
    """How many pixels' rays meet a ball's influence sphere."""
    origins, directions = (array.reshape(-1, 3) for array in camera.view_rays())
    rotation = camera.world_from_view[:3, :3]
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ rotation.T
    origins = origins @ rotation.T + camera.eye
    met = np.zeros(len(origins), bool)
    for center, radius in zip(scene.balls.positions.astype(float), scene.balls.radii, strict=True):
        met |= np.linalg.norm(np.cross(center - origins, directions), axis=1) < radius
    return int(met.sum())


def test_distances_converge_with_the_square_of_the_step():
    """Those of the secants over the last step, where no step shortens by itself."""
    scene = SCENES["two_balls"]()
    want = expected(scene.balls, scene.field, scene.camera("perspective"))
    steps = (1 / 8, 1 / 16, 1 / 32, 1 / 64)
    errors = []
    for step in steps:
        image = render(scene, step=step, tolerance=0.25, refinements=0)
        both = image.hit.ravel() & np.isfinite(want.t)
        apart = np.abs(image["depth"].ravel() * want.stretch - want.t)[both] / want.radius[both]
        # Without rays that all but touch, of which some find another root.
        errors.append(np.quantile(apart, 0.95))
    order, _ = np.polyfit(np.log2(steps), np.log2(errors), 1)
    assert order == pytest.approx(2, abs=0.2), errors


def test_coverage_converges_with_the_step():
    """Rays that miss the surface, or find it where there is none: the longest step misses many, that of the defaults none."""
    scene = SCENES["lattice_with_droplets"]()
    camera = scene.camera("perspective")
    should_hit = np.isfinite(expected(scene.balls, scene.field, camera).t)
    wrong = [np.count_nonzero(render(scene, step=step).hit.ravel() != should_hit) for step in (2.0, 1.0, 0.5)]
    assert wrong[0] > 50
    assert 0 < wrong[1] < wrong[0] / 5
    assert wrong[2] <= 1e-4 * camera.width * camera.height


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_balls_a_thousand_times_smaller_are_not_stepped_over(projection):
    """They float in a large one too thin to be seen, through which steps are long; behind is one that is seen."""
    small = np.random.default_rng(3).uniform(-0.004, 0.004, (60, 3))
    radii, weights = np.repeat([1e-3, 1.0, 1.0], [60, 1, 1]), np.repeat([1.0, 0.1, 1.0], [60, 1, 1])
    balls = meniscus.Balls(np.concatenate([small, [[0.1, 0, 0], [0, 1.9, 0]]]), radii, weights)
    scene = Scene(balls, eye=(0.0, -2.0, 0.0), view_height=0.01)
    camera = scene.camera(projection)
    image = render(scene, camera)
    verdict = compare(image, scene, camera)
    assert 0.1 < (image["depth"] < 2.1).mean() < 0.9, "small balls should be seen, and the large one"
    assert image.hit.all()
    assert len(verdict.wrong) <= 1, verdict.wrong
    assert image.info.counts["passes"] < 100


def test_gaps_are_leapt_over():
    """However wide they are by the size of the balls."""
    positions = [[0.3, 10.0**power, 0] for power in range(6)] + [[0, 2e5, 0]]
    scene = Scene(meniscus.Balls(positions, [0.28] * 6 + [9e4]), eye=(0.0, -0.5, 0.0), view_height=1.0, clip_end=1e6)
    camera = scene.camera("orthographic")
    image = render(scene, camera)
    assert not compare(image, scene, camera).wrong
    assert image.info.counts["passes"] < 100, "by steps alone there would be millions"


def test_limits_leave_out_what_has_not_arrived_and_count_it():
    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = render(scene)
    assert whole.info.counts["unfinished"] == 0
    assert whole.info.counts["rays"] == met_pixels(scene, camera)
    for settings in ({"most_passes": 2}, {"finished": 0.7}):
        image = render(scene, **settings)
        counts = image.info.counts
        assert 0 < counts["unfinished"] < counts["rays"]
        assert counts["finished"] + counts["unfinished"] == counts["rays"] == met_pixels(scene, camera)
        assert counts["passes"] < whole.info.counts["passes"]
        assert 0 < image.hit.sum() < whole.hit.sum()
        assert not image.hit[~whole.hit].any()
        np.testing.assert_array_equal(image["depth"][~image.hit], np.float32(1e10))
        # What has arrived is not far from its place, even if brackets are still wide.
        np.testing.assert_allclose(image["depth"][image.hit], whole["depth"][image.hit], atol=0.05)
    assert render(scene, finished=0.7).info.counts["finished"] >= 0.7 * whole.info.counts["rays"]


def test_a_tiny_budget_ends_the_walk_early_and_a_large_one_changes_nothing(clock):
    scene = SCENES["ten_balls"]()
    without = render(scene)
    tiny = render(scene, use_budget=True, budget=7.0)
    counts = tiny.info.counts
    assert 1 <= counts["passes"] < without.info.counts["passes"]
    assert 0 < counts["unfinished"] < counts["rays"]
    assert counts["finished"] + counts["unfinished"] == counts["rays"] == without.info.counts["rays"]
    assert 0 < tiny.hit.sum() < without.hit.sum()
    assert not tiny.hit[~without.hit].any()
    large = render(scene, use_budget=True, budget=60000.0)
    assert large.info.counts == without.info.counts
    for name in ("depth", "normal"):
        np.testing.assert_array_equal(large[name], without[name])


def test_there_is_always_one_pass(clock):
    clock.seconds = 10.0
    scene = SCENES["ten_balls"]()
    image = render(scene, use_budget=True, budget=1.0)
    assert image.info.counts["passes"] == 1
    assert image.info.counts["unfinished"] > 0


def test_the_time_that_is_left_is_shared_by_the_parts_of_an_image(clock, monkeypatch):
    from meniscus.gpu_shaders.sampling import method as sampling

    scene = SCENES["ten_balls"]()
    camera = scene.camera("perspective")
    whole = render(scene, use_budget=True, budget=60000.0)
    monkeypatch.setattr(sampling, "_PIXELS_A_PART", 14 * camera.width)
    in_parts = render(scene, use_budget=True, budget=60000.0)
    np.testing.assert_array_equal(in_parts.hit, whole.hit)
    np.testing.assert_allclose(in_parts["depth"], whole["depth"], rtol=1e-4)
    assert in_parts.info.counts["rays"] == whole.info.counts["rays"]
    clock.now = 0.0
    render(scene, use_budget=True, budget=40.0)
    assert clock.now < 0.060, "each part takes its share, and one pass at least"


def test_without_time_there_is_no_budget():
    scene = SCENES["one_ball"]()
    with pytest.raises(InputError, match=r"^The setting 'budget' cannot be 0\.0: give a number from 1 to 60000$"):
        render(scene, use_budget=True, budget=0)


class ScriptedClock:
    """Gives the times that a test has set."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_a_pass_is_begun_only_where_it_and_all_that_follows_end_in_time():
    clock = ScriptedClock()
    budget = Budget(clock, 1.0, 100, Experience())
    budget.begin_part(100)
    assert budget.allows_pass(0), "nothing is known of passes yet"
    clock.now = 0.1
    budget.note_pass()
    # 0.1 a pass, FIRST_GUESS times 0.1 for what follows.
    clock.now = 1.0 - 0.1 * FIRST_GUESS - 0.25
    assert budget.allows_pass(1)
    assert not budget.allows_pass(2)
    clock.now = 1.0 - 0.1 * FIRST_GUESS - 0.05
    assert not budget.allows_pass(0)


def test_what_frames_take_in_the_end_is_learned():
    clock, experience = ScriptedClock(), Experience()
    budget = Budget(clock, 1.0, 100, experience)
    budget.begin_part(100)
    clock.now = 0.01
    budget.note_pass()
    clock.now = 0.21
    budget.note_end()
    assert experience.ending == pytest.approx(20)
    experience.note(4)
    assert 4 < experience.ending < 20
    for _ in range(50):
        experience.note(4)
    assert experience.ending == pytest.approx(4, rel=1e-3)


def test_parts_get_their_share_of_the_time():
    clock = ScriptedClock()
    budget = Budget(clock, 1.0, 100, Experience(ending=0.0))
    budget.begin_part(25)
    clock.now = 0.2
    budget.note_pass()
    assert not budget.allows_pass(0)
    clock.now = 0.4
    budget.begin_part(75)
    clock.now = 0.6
    budget.note_pass()
    clock.now = 0.75
    assert budget.allows_pass(0)


def test_the_method_on_the_device_keeps_the_budget_too(clock, opengl):
    scene = SCENES["ten_balls"]()
    method = opengl.kept(walking.WalkingDepthPlane)
    from meniscus.addon.render.method import Request
    from meniscus.addon.render.settings import checked_settings

    settings = checked_settings(METHOD, walking.METHOD.settings, {"use_budget": True, "budget": 7.0})
    camera = scene.camera("perspective")
    request = Request(scene.balls, camera, scene.field, frozenset(), 0, lambda _: None, settings=settings)
    textures = method.find_surface_on_device(request)
    assert textures.counts["unfinished"] > 0
    whole = method.find_surface_on_device(replace(request, settings={**settings, "use_budget": False}))
    assert whole.counts["unfinished"] == 0
    found, every = (np.asarray(surface.read_back()["depth"]) for surface in (textures, whole))
    assert np.count_nonzero(found < 1e9) < np.count_nonzero(every < 1e9)
