"""Live views: the newest view counts, coarse comes before fine, and nothing is rendered twice."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import CancelledError, DeviceError
from meniscus.addon.fluid.image import ImageBuffers, RenderInfo
from meniscus.addon.fluid.tracing import Tracing
from meniscus.addon.render.cluster_numbers import known_counts
from meniscus.addon.render.live_view import LiveRenderer, View
from meniscus.addon.render.method_choice import MethodChoice
from meniscus.addon.render.pace import Pace
from meniscus.addon.render.samples import sample_offset
from meniscus.addon.render.settings import Setting
from meniscus.addon.render.tile_caster import params

CAMERA = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=1000, height=600)
BALLS = meniscus.Balls([[0, 0, 0], [0.5, 0, 0]], 0.9)
VIEW = View(BALLS, CAMERA, meniscus.Field(), samples=4)
SOON = 10.0
"""Seconds: far more than anything here takes."""


def moved(view, x):
    return replace(view, camera=meniscus.Camera.perspective((x, -4, 0), (0, 0, 0), width=1000, height=600))


class FakeRender:
    """Notes what it is asked for; waits where a test holds it."""

    def __init__(self):
        self.cameras, self.instants = [], []
        self.going = threading.Event()
        self.going.set()
        self.begun = threading.Event()
        self.failure = None

    def __call__(self, balls, camera, field, is_cancelled, instant=None, **_):
        self.cameras.append(camera)
        self.instants.append(instant)
        self.begun.set()
        while not self.going.wait(0.001):
            if is_cancelled():
                raise CancelledError("The render was cancelled")
        if self.failure:
            raise self.failure
        shape = (camera.height, camera.width)
        return ImageBuffers(camera, {"depth": np.ones(shape, np.float32)}, np.ones(shape, bool), RenderInfo())

    def hold(self):
        self.begun.clear()
        self.going.clear()

    @property
    def widths(self):
        return [camera.width for camera in self.cameras]


@pytest.fixture
def fake():
    return FakeRender()


@pytest.fixture
def renderer(fake):
    renderer = LiveRenderer(fake)
    yield renderer
    fake.going.set()
    renderer.close()


def rest(live):
    """Wait until nothing more will come."""
    with live._changed:
        assert live._changed.wait_for(lambda: live._stage() is None, SOON)


def test_a_view_is_refined_and_then_antialiased(renderer, fake):
    live = renderer.open()
    live.show(VIEW)
    rest(live)
    assert fake.widths[0] < 1000
    assert fake.widths[1:] == [1000] * 4
    assert [picture.image.camera for picture in live.pictures] == fake.cameras[1:]
    centre = fake.cameras[1].window
    assert centre == CAMERA.window
    assert len({camera.window.left for camera in fake.cameras[1:]}) == 4
    pixel, _ = CAMERA.pixel_size
    assert all(abs(camera.window.left - centre.left) <= pixel / 2 for camera in fake.cameras[1:])


def test_the_same_view_is_not_rendered_again(renderer, fake):
    live = renderer.open()
    live.show(VIEW)
    rest(live)
    done, revision = len(fake.cameras), live.revision
    live.show(replace(VIEW, frame_rate=60.0))
    assert live.is_at_rest
    assert live.wait(0)
    assert (len(fake.cameras), live.revision) == (done, revision)
    live.show(replace(VIEW, samples=6))
    rest(live)
    assert len(fake.cameras) == done + 2, "more samples are added to those that there are"


@pytest.mark.parametrize(
    "change",
    [
        {"balls": meniscus.Balls([[0, 0, 1]], 0.9)},
        {"field": meniscus.Field(isovalue=0.3)},
        {"passes": ("depth", "normal", "velocity")},
        {"camera": meniscus.Camera.perspective((0, -5, 0), (0, 0, 0), width=1000, height=600)},
        {"choice": MethodChoice(backend="cpu")},
        {"choice": MethodChoice("fitted_bvh", settings={"step": 2})},
        {"cluster_sources": (0,)},
        {"counts_clusters": True},
    ],
)
def test_whatever_changes_the_image_asks_for_a_new_one(renderer, fake, change):
    live = renderer.open()
    live.show(VIEW)
    rest(live)
    view = replace(VIEW, **change)
    live.show(view)
    assert live.wait(SOON)
    assert live.pictures[0].view.shows_the_same(view)


def test_images_of_a_view_are_one_sequence_and_know_their_time(renderer, fake):
    live, other = renderer.open(), renderer.open()
    for view, seconds in ((live, 1.0), (live, 1.5), (other, 1.5)):
        view.show(replace(VIEW, balls=meniscus.Balls([[0, 0, 0]], 0.9), seconds=seconds, samples=1))
        assert view.wait(SOON)
    seconds, sequences = zip(*((instant.seconds, instant.sequence) for instant in fake.instants), strict=True)
    assert set(seconds) == {1.0, 1.5}
    assert len(set(sequences)) == 2
    assert sequences[0] is sequences[seconds.index(1.5)] is not sequences[-1]


def test_the_newest_view_wins_and_those_between_are_never_rendered(renderer, fake):
    live = renderer.open()
    fake.hold()
    live.show(VIEW)
    assert fake.begun.wait(SOON)
    for x in (1, 2, 3):
        live.show(moved(VIEW, x))
    fake.going.set()
    assert live.wait(SOON)
    assert [camera.eye[0] for camera in fake.cameras[:2]] == [0, 3]


def test_a_first_picture_is_finished_and_shown_though_the_view_has_moved_on(renderer, fake):
    live = renderer.open()
    fake.hold()
    live.show(VIEW)
    assert fake.begun.wait(SOON)
    live.show(moved(VIEW, 1))
    assert not live.wait(0.05)
    fake.going.set()
    assert live.wait(SOON)
    assert live.revision >= 2, "the first one was there to be shown"


def test_refinement_gives_way_to_a_new_view(renderer, fake):
    live = renderer.open()
    live.show(VIEW)
    assert live.wait(SOON)
    fake.hold()
    assert fake.begun.wait(SOON), "the refinement"
    live.show(moved(VIEW, 1))
    fake.begun.clear()
    assert fake.begun.wait(SOON), "the refinement was cancelled for the new view, though it never ended"
    assert fake.cameras[-1].eye[0] == 1
    fake.going.set()


def test_a_view_without_a_picture_comes_before_the_refinement_of_another(renderer, fake):
    first, second = renderer.open(), renderer.open()
    first.show(VIEW)
    assert first.wait(SOON)
    fake.hold()
    assert fake.begun.wait(SOON)
    second.show(moved(VIEW, 1))
    fake.begun.clear()
    assert fake.begun.wait(SOON)
    assert fake.cameras[-1].eye[0] == 1
    fake.going.set()
    rest(first)
    rest(second)
    assert len(first.pictures) == len(second.pictures) == 4


def test_a_dropped_view_is_rendered_no_more(renderer, fake):
    live = renderer.open()
    live.show(VIEW)
    assert live.wait(SOON)
    fake.hold()
    assert fake.begun.wait(SOON)
    renderer.drop(live)
    other = renderer.open()
    other.show(moved(VIEW, 1))
    fake.going.set()
    rest(other)
    assert len(live.pictures) == 1


def test_memory_limits_the_samples(renderer, fake):
    live = renderer.open()
    live.show(replace(VIEW, samples=64, memory_limit=3 * 1000 * 600 * 4 * 4 + 100))
    rest(live)
    assert len(live.pictures) == 3
    live.show(replace(VIEW, samples=64, memory_limit=0, field=meniscus.Field(isovalue=0.3)))
    rest(live)
    assert len(live.pictures) == 1


@pytest.mark.parametrize(
    ("failure", "sentence", "has_traceback"),
    [(DeviceError("The driver is gone"), "The driver is gone", False), (ZeroDivisionError("by zero"), "by zero", True)],
)
def test_a_failure_is_told_once_and_ends_with_the_next_view(renderer, fake, failure, sentence, has_traceback):
    live = renderer.open()
    fake.failure = failure
    live.show(VIEW)
    assert live.wait(SOON)
    text, details = live.failure
    assert sentence in text
    assert ("Traceback" in details) == has_traceback
    assert live.is_at_rest, "it does not try again and again"
    assert len(fake.cameras) == 1
    fake.failure = None
    live.show(moved(VIEW, 1))
    assert live.wait(SOON)
    assert live.failure is None
    assert live.pictures


def test_the_last_picture_stays_when_the_next_view_fails(renderer, fake):
    live = renderer.open()
    live.show(VIEW)
    rest(live)
    fake.failure = DeviceError("The driver is gone")
    live.show(moved(VIEW, 1))
    assert live.wait(SOON)
    assert live.failure
    assert live.pictures[0].view.shows_the_same(VIEW)


def test_closing_does_not_wait_for_a_picture_under_way(fake):
    renderer = LiveRenderer(fake)
    live = renderer.open()
    fake.hold()
    live.show(VIEW)
    assert fake.begun.wait(SOON)
    closing = threading.Thread(target=renderer.close)
    closing.start()
    closing.join(SOON)
    assert not closing.is_alive()


def test_real_pictures_are_those_of_the_renderer():
    renderer = LiveRenderer()
    live = renderer.open()
    view = replace(VIEW, choice=MethodChoice(backend="cpu"), samples=2, camera=CAMERA.resized(100, 60))
    live.show(view)
    rest(live)
    renderer.close()
    first, second = live.pictures
    exact = meniscus.render(BALLS, view.camera, view.field, backend="cpu")
    np.testing.assert_array_equal(first.image["depth"], exact["depth"])
    assert first.image.hit.any()
    changed = first.image.hit != second.image.hit
    assert 0 < changed.sum() < 0.1 * changed.size, "jittered rays differ at the silhouette"
    depth = first.image["depth"][first.image.hit]
    assert first.depth_range[0] <= depth.min()
    assert depth.max() <= first.depth_range[1]
    assert first.depth_range == pytest.approx((3.1, 4.9))


def test_samples_are_spread_evenly_over_the_pixel():
    for count in (4, 8, 16, 32):
        offsets = np.array([sample_offset(sample) for sample in range(count)])
        assert np.all(np.abs(offsets) <= 0.5)
        assert np.all(np.abs(offsets.mean(axis=0)) < 1 / count), "by less than one sample can move it"
        gaps = np.linalg.norm(offsets[:, None] - offsets[None], axis=2) + 9 * np.eye(count)
        assert gaps.min() > 0.4 / np.sqrt(count)
    assert sample_offset(0) == (0, 0)


class TestPace:
    """How large images may be, given what earlier ones took."""

    def pixels(self, pace, interval=1 / 24):
        width, height = pace.size(1080, 700, interval)
        return width * height

    def learned(self, base, per_pixel, sizes=(47_250, 756_000)):
        pace = Pace()
        for pixels in sizes:
            pace.note(pixels, base + per_pixel * pixels)
        return pace

    def test_the_first_image_is_small(self):
        assert self.pixels(Pace()) < 130_000

    def test_a_fast_machine_gets_the_whole_size(self):
        assert Pace.size(self.learned(0.001, 5e-9), 1080, 700, 1 / 24) == (1080, 700)

    def test_a_slower_one_gets_the_largest_part_that_fits(self):
        pace = self.learned(0.005, 5e-8)
        pixels = self.pixels(pace)
        assert pixels < 756_000
        assert 0.005 + 5e-8 * pixels <= 0.5 / 24
        assert self.pixels(pace, interval=1 / 60) < pixels < self.pixels(pace, interval=1 / 10)

    def test_bringing_the_image_to_the_screen_counts(self):
        pace = self.learned(0.001, 5e-9)
        pace.note_presenting(756_000, 0.02)
        assert self.pixels(pace) == 756_000 / 4

    def test_small_images_are_not_made_where_they_save_nothing(self):
        # No size comes in time; the half of each side takes 0.04 seconds more than none.
        assert Pace.size(self.learned(0.2, 2e-7), 1080, 700, 1 / 24) == (540, 350)

    def test_what_changes_is_learned_anew(self):
        pace = self.learned(0.001, 5e-9)
        pace.note(756_000, 1.0)
        assert self.pixels(pace) < 756_000

    def test_noise_does_not_matter_to_odd_sizes(self):
        pace = Pace()
        pace.note(100, 0.02)
        pace.note(756_000, 0.01)
        assert pace.size(1080, 700, 1 / 24) == (1080, 700)
        assert Pace().size(1, 1, 1 / 24) == (1, 1)


def test_what_the_next_balls_need_is_begun_while_the_last_are_drawn(fake):
    asked = []
    renderer = LiveRenderer(fake, prepare=lambda *arguments: asked.append(arguments))
    try:
        live = renderer.open()
        live.show(VIEW)
        rest(live)
        assert asked == [], "nothing may be loaded while Blender draws"
        fake.hold()
        live.show(moved(VIEW, 1.0))
        assert fake.begun.wait(SOON)
        balls = meniscus.Balls([[0, 0, 1]], 0.9)
        live.show(replace(VIEW, balls=balls, choice=MethodChoice("fitted_bvh")))
        assert asked == [(balls, VIEW.field, "fitted_bvh", "auto", 0)], "the thread is still busy"
    finally:
        fake.going.set()
        renderer.close()


def test_light_goes_less_far_while_a_view_moves(renderer, fake):
    """And what was shown then is no sample of what rests, however large it was; each sample has other rays."""
    asked = []
    renderer._render = lambda *arguments, look, sample, **names: (
        asked.append((look.tracing.samples, look.tracing.reflections, sample)) or fake(*arguments, **names)
    )
    look = meniscus.Look("material", tracing=Tracing(reflections=5, samples=3))
    view = replace(VIEW, look=look, camera=CAMERA.resized(100, 60), samples=3)
    live = renderer.open()
    live.show(view)
    rest(live)
    assert asked == [(1, 2, 0), (3, 5, 0), (3, 5, 1), (3, 5, 2)]
    assert fake.widths == [100] * 4
    assert [picture.is_hurried for picture in live.pictures] == [False] * 3


def test_what_holds_the_pace_counts_only_while_a_view_moves(renderer, fake, monkeypatch):
    asked = []
    renderer._render = lambda *arguments, settings, **names: asked.append(dict(settings)) or fake(*arguments, **names)
    known = (Setting("step", "Step", "", 1, 1, 9), Setting("budget", "Budget", "", 0.0, is_for_motion=True))
    monkeypatch.setattr(params, "METHOD", replace(params.METHOD, settings=known))
    choice = MethodChoice("tile_caster", settings={"step": 3, "budget": 0.5})
    live = renderer.open()
    live.show(replace(VIEW, choice=choice, camera=CAMERA.resized(100, 60), samples=2))
    rest(live)
    assert asked == [{"step": 3, "budget": 0.5}, {"step": 3}, {"step": 3}]
    assert fake.widths == [100] * 3
    assert [picture.is_hurried for picture in live.pictures] == [False] * 2


def test_balls_take_the_colours_of_their_clusters_beside_the_interface(renderer, fake):
    """Two drops; the thread that renders colours and counts them, and the balls that were given stay what they are."""
    fluid = meniscus.Balls([[-2, 0, 0], [2, 0, 0]], 0.9, colors=(0.5, 0.5, 0.5), sources=[0, 1])
    given = []
    live = renderer.open()
    original = renderer._render
    renderer._render = lambda balls, *others, **named: given.append(balls) or original(balls, *others, **named)
    live.show(replace(VIEW, balls=fluid, cluster_sources=(1,)))
    rest(live)
    expected = meniscus.colored_by_cluster(fluid, VIEW.field, (1,))
    assert set(given) == {expected}
    assert expected.colors[0].tolist() == [0.5, 0.5, 0.5]
    live.show(replace(VIEW, balls=fluid, counts_clusters=True))
    rest(live)
    assert given[-1] is fluid
    assert known_counts(fluid, VIEW.field)["clusters"] == 2
