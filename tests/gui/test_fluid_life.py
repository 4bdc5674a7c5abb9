"""The fluid comes and goes with what it is made of: undo, files, deleted sources, the extension itself, and errors."""

import addon_utils
import bpy
import pytest
from blender_fixtures import EXTENSION
from event_loop import turns, wait_until
from fluid_scenes import add_points
from mathutils import Euler
from recorder import recording
from viewports import Viewport, look


@pytest.fixture
def drop(new_file, fluid):
    """The first viewport, with a fluid of a few balls and no cube."""
    shown = fluid.prepare()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    add_points(bpy.context.scene.collection, "Drop", [(0, 0, 0), (0.5, 0, 0), (0, 0.4, 0.5)], radius=1.0)
    look(shown.view, Euler((1.0, 0, 0.5)).to_quaternion(), 9.0)
    fluid.check_presence("drop", shown)
    return shown


def test_undo_and_redo(fluid, drop):
    with drop.override():
        bpy.ops.ed.undo_push(message="with fluid")
        bpy.data.objects["Drop"].meniscus.use_fluid = False
        bpy.ops.ed.undo_push(message="without fluid")
    fluid.check_absence("before_undo", drop)
    with drop.override():
        bpy.ops.ed.undo()
    fluid.check_presence("undone", drop)
    with drop.override():
        bpy.ops.ed.redo()
    fluid.check_absence("redone", drop)


def test_a_source_that_moves_and_is_deleted(fluid, drop):
    bpy.data.objects["Drop"].location.x = 1.5
    turns()
    fluid.check_presence("moved", drop)
    bpy.data.objects.remove(bpy.data.objects["Drop"])
    fluid.check_absence("deleted", drop)


def test_other_files(fluid, drop, tmp_path):
    path = str(tmp_path / "drop.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with drop.override():
        bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(3)
    fluid.check_absence("no_data_of_the_extension", Viewport())
    with Viewport().override():
        bpy.ops.wm.open_mainfile(filepath=path)
    turns(3)
    fluid.check_presence("opened", Viewport())


def test_disabling_and_enabling(fluid, drop):
    addon_utils.disable(EXTENSION)
    try:
        drop.redraw(3)
        fluid.check_absence("disabled", drop)
    finally:
        addon_utils.enable(EXTENSION)
    fluid.check_presence("enabled_again", drop)


def test_an_error_in_the_draw_handler_is_shown_once_and_pauses_drawing(fluid, drop, monkeypatch):
    calls = []

    def fail(*_):
        calls.append(None)
        raise ZeroDivisionError("broken on purpose")

    with monkeypatch.context() as patch:
        patch.setattr(fluid.module("presenter").Presenter, "draw", fail)
        bpy.data.objects["Drop"].location.x = 0.5
        drop.redraw(10)
        assert len(calls) == 1, "drawing should pause"
        assert "broken on purpose" in fluid.status.problem
        assert "ZeroDivisionError" in fluid.status.details
        turns(100)
        with recording() as recorder:
            turns(50)
        assert len(recorder.drawn) <= 1, "nothing should be drawn again while drawing pauses"
    bpy.data.objects["Drop"].location.x = 1.0
    turns()
    fluid.check_presence("after_the_error", drop)
    assert not fluid.status.problem


def test_what_the_user_can_mend_is_said_and_mended(fluid, drop):
    settings = bpy.data.objects["Drop"].meniscus
    settings.radius_mode, settings.radius_attribute = "ATTRIBUTE", "nowhere"
    turns(3)
    assert "nowhere" in fluid.status.problem
    assert not fluid.status.details
    settings.radius_attribute = "radius"
    turns(3)
    fluid.check_presence("mended", drop)


def test_a_viewport_that_looks_away_rests(fluid, drop):
    look(drop.view, Euler((0, 0, 0)).to_quaternion(), 0.1, location=(0, 0, -50))
    fluid.check_absence("looked_away", drop)
    drawing = fluid.module("viewport")._drawing
    wait_until(lambda: not bpy.app.timers.is_registered(drawing._timer), "the timer to end")


def test_a_problem_ends_with_what_caused_it(fluid, drop):
    item = bpy.data.objects["Drop"]
    item.meniscus.radius_mode, item.meniscus.radius_attribute = "ATTRIBUTE", "nowhere"
    wait_until(lambda: "nowhere" in fluid.status.problem, "the problem")
    item.meniscus.use_fluid = False
    wait_until(lambda: not fluid.status.problem, "its end")
    assert fluid.lives() == []
