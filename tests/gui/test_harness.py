"""The tests' own tools, judged by Blender's own drawing: if these fail, believe nothing that the others say."""

import bpy
import numpy as np
import pytest
from event_loop import turns, wait_until
from expected import box, is_inner, nearest, srgb_bytes
from mathutils import Euler
from pictures import check_same
from viewports import look, settled, viewport

ROTATION = Euler((1.0, 0.2, 0.5)).to_quaternion()


@pytest.mark.parametrize("perspective", ["PERSP", "ORTHO"])
def test_the_screen_shows_where_rays_meet_a_cube(new_file, perspective):
    shown = viewport()
    bpy.data.objects["Cube"].color = (0.9, 0.2, 0.1, 1)
    look(shown.view, ROTATION, 9.0, (0.5, 0.2, 0), perspective)
    actual = settled(shown)
    labels = nearest([box((0, 0, 0), 1.0)], shown.clip_from_world, shown.region.width, shown.region.height)
    assert 0.02 < (labels == 0).mean() < 0.5
    colors = np.array([srgb_bytes((0.9, 0.2, 0.1)), srgb_bytes((0.1, 0.1, 0.1))])
    check_same(f"cube_{perspective}", actual, colors[labels], is_inner(labels))


def test_timers_and_draw_handlers_run_while_a_test_waits(new_file):
    calls = {"timer": 0, "handler": 0}

    def count(name):
        calls[name] += 1

    handler = bpy.types.SpaceView3D.draw_handler_add(count, ("handler",), "WINDOW", "POST_VIEW")
    bpy.app.timers.register(lambda: count("timer"))
    try:
        viewport().redraw(3)
        wait_until(lambda: calls["timer"] == 1, "a timer")
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    assert calls["handler"] >= 3


def test_waiting_ends():
    with pytest.raises(AssertionError, match="in vain for what never comes"):
        wait_until(lambda: False, "what never comes", seconds=0.1)


def test_a_traceback_in_a_handler_is_noticed(new_file, capfd):
    from complaints import complaints

    handler = bpy.types.SpaceView3D.draw_handler_add(lambda: 1 / 0, (), "WINDOW", "POST_VIEW")
    viewport().redraw()
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    turns()
    assert complaints(capfd.readouterr().err)
