"""Settings of methods: what is checked, and that they arrive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import InputError
from meniscus.addon.render import renderer
from meniscus.addon.render.deep import render_deep
from meniscus.addon.render.method_choice import MethodChoice
from meniscus.addon.render.registry import method_infos
from meniscus.addon.render.settings import Setting
from meniscus.addon.render.tile_caster import params

STEP = Setting("step", "Step", "Width of a step", 0.5, 0.1, 1.0)
COUNT = Setting("count", "Count", "How many", 8, 1, 64)
SWITCH = Setting("use_bisection", "Bisection", "Whether to halve", True)

BALLS = meniscus.Balls([[0, 0, 0]], 0.9)
CAMERA = meniscus.Camera.orthographic((0, -4, 0), (0, 0, 0), scale=2, width=8, height=8)


@pytest.fixture
def requests(monkeypatch):
    """What the Tile Caster, which has settings in these tests, was asked for."""
    asked = []
    create = renderer.create_method

    class Recorder:
        def __init__(self, runner):
            self.runner = runner
            self.device = runner.device

        def find_surface(self, request):
            asked.append(request)
            return self.runner.find_surface(request)

    def create_with_settings(name):
        info, runner = create(name)
        return replace(info, settings=(STEP, COUNT, SWITCH)), Recorder(runner)

    monkeypatch.setattr(renderer, "create_method", create_with_settings)
    return asked


def render(**options):
    return meniscus.render(BALLS, CAMERA, meniscus.Field(), **{"method": "tile_caster", **options})


def test_what_is_left_out_has_its_default(requests):
    render()
    render(settings={"count": 3})
    render(settings={"step": 1, "use_bisection": False})
    assert [request.settings for request in requests] == [
        {"step": 0.5, "count": 8, "use_bisection": True},
        {"step": 0.5, "count": 3, "use_bisection": True},
        {"step": 1.0, "count": 8, "use_bisection": False},
    ]
    assert isinstance(requests[2].settings["step"], float)


def test_every_way_to_render_takes_settings(requests):
    given = {"method": "tile_caster", "settings": {"count": 5}}
    list(renderer.render_progressively(BALLS, CAMERA, meniscus.Field(), **given))
    renderer.render_to_show(BALLS, CAMERA, meniscus.Field(), **given)
    render_deep(BALLS, CAMERA, meniscus.Field(), **given)
    assert [request.settings["count"] for request in requests] == [5, 5, 5]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"stride": 1}, r"^The method 'tile_caster' has no setting 'stride': it has step, count, use_bisection$"),
        ({"step": 1.1}, r"^The setting 'step' cannot be 1\.1: give a number from 0\.1 to 1$"),
        ({"step": math.nan}, r"^The setting 'step' cannot be nan: give a number from 0\.1 to 1$"),
        ({"step": "wide"}, r"^The setting 'step' cannot be 'wide': give a number from 0\.1 to 1$"),
        ({"step": True}, r"^The setting 'step' cannot be True: give a number from 0\.1 to 1$"),
        ({"count": 0}, r"^The setting 'count' cannot be 0: give a whole number from 1 to 64$"),
        ({"count": 2.0}, r"^The setting 'count' cannot be 2\.0: give a whole number from 1 to 64$"),
        ({"count": True}, r"^The setting 'count' cannot be True: give a whole number from 1 to 64$"),
        ({"use_bisection": 1}, r"^The setting 'use_bisection' is a switch and cannot be 1: give True or False$"),
    ],
)
def test_what_cannot_be_set_is_told_in_one_sentence(requests, settings, message):
    with pytest.raises(InputError, match=message):
        render(settings=settings)
    assert not requests


def test_a_method_without_settings_takes_none():
    assert render(settings={}).hit.any()
    with pytest.raises(InputError, match="has no setting 'step': it has none"):
        render(settings={"step": 0.5})


def test_settings_need_a_method_by_name():
    assert render(method="auto", backend="cpu", settings={}).hit.any()
    with pytest.raises(InputError, match="the method is automatic"):
        render(method="auto", backend="cpu", settings={"step": 0.5})


def test_numbers_of_numpy_become_plain_ones():
    assert type(COUNT.checked(np.int32(3))) is int
    assert type(STEP.checked(np.float32(0.5))) is float
    assert type(STEP.checked(1)) is float


@pytest.mark.parametrize(
    ("setting", "text", "value"),
    [
        (STEP, "0.25", 0.25),
        (STEP, "1", 1.0),
        (COUNT, " 12", 12),
        (SWITCH, "off", False),
        (SWITCH, "True", True),
        (SWITCH, "0", False),
    ],
)
def test_values_are_read_from_text(setting, text, value):
    assert setting.from_text(text) == value
    assert type(setting.from_text(text)) is type(value)


@pytest.mark.parametrize(
    ("setting", "text"),
    [(STEP, "wide"), (STEP, "nan"), (STEP, "2"), (COUNT, "2.5"), (COUNT, "65"), (SWITCH, "perhaps"), (SWITCH, "2")],
)
def test_text_that_is_no_value_is_told_in_one_sentence(setting, text):
    with pytest.raises(InputError, match=f"^The setting '{setting.name}' .*: give "):
        setting.from_text(text)


def test_a_choice_takes_what_a_user_writes(requests, monkeypatch):
    monkeypatch.setattr(params, "METHOD", replace(params.METHOD, settings=(STEP, COUNT, SWITCH)))
    choice = MethodChoice("tile_caster", settings={"count": 3, "step": 0.2}).with_written(
        [("step", "0.25"), ("use_bisection", "no")]
    )
    assert choice.settings == {"count": 3, "step": 0.25, "use_bisection": False}
    with pytest.raises(InputError, match="has no setting 'stride': it has step, count, use_bisection"):
        choice.with_written([("stride", "1")])
    with pytest.raises(InputError, match="the method is automatic"):
        MethodChoice().with_written([("step", "1")])
    with pytest.raises(InputError, match="Unknown method 'voxels'"):
        MethodChoice("voxels").with_written([("step", "1")])


def test_ranges_may_be_open():
    assert Setting("n", "N", "", 1).range == "a whole number"
    assert Setting("n", "N", "", 1.0, minimum=0).range == "a number from 0 up"
    assert Setting("n", "N", "", 1.0, maximum=2).range == "a number up to 2"


def test_defaults_of_all_methods_are_in_their_range():
    for info in method_infos():
        assert len({setting.name for setting in info.settings}) == len(info.settings)
        for setting in info.settings:
            assert setting.name.isidentifier()
            assert setting.name.islower()
            assert setting.checked(setting.default) == setting.default
