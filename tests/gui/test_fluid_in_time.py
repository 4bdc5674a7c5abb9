"""Whatever frame a viewport shows, the fluid in it is that frame's: while it plays, is scrubbed, and between frames."""

import bpy
import numpy as np
import pytest
from event_loop import turns, wait_until
from expected import is_inner
from fluid_scenes import add_emitter, play
from fluid_views import is_bluish, mask
from mathutils import Euler
from pictures import check_same
from recorder import recording
from viewports import look

BAND = 12
"""Pixels around the fluid's border that do not count while things move: images are coarser then."""

LAST = 24


@pytest.fixture
def jet(new_file, fluid):
    """The first viewport, with an emitter whose particles fly up through the picture, born from frame 5 on."""
    scene = bpy.context.scene
    shown = fluid.prepare()
    bpy.data.objects["Cube"].hide_set(True)
    scene.frame_start, scene.frame_end = 1, LAST
    jet = add_emitter(scene.collection, frame_start=5, frame_end=10, count=20, normal_factor=8, particle_size=0.15)
    jet.meniscus.radius_factor = 4.0
    jet.show_instancer_for_viewport = False  # its square would hide some
    look(shown.view, Euler((np.pi / 2, 0, 0)).to_quaternion(), 16.0, (0, 0, 2))
    play(scene, LAST)
    scene.frame_set(1)
    turns(3)
    return shown


def check_each(fluid, drawn):
    """Each picture is that of its frame: compared with balls that are read anew for it."""
    for picture in drawn:
        whole = int(np.floor(picture.frame))
        bpy.context.scene.frame_set(whole, subframe=picture.frame - whole)
        is_fluid = fluid.is_fluid(picture.clip_from_world, picture.colors.shape)
        check_same(f"frame_{picture.frame}", mask(is_bluish(picture.colors)), mask(is_fluid), is_inner(is_fluid, BAND))
    return {picture.frame for picture in drawn if is_bluish(picture.colors).sum() > 500}


def test_playing(fluid, jet):
    with jet.override():
        bpy.ops.screen.animation_play()
    with recording() as recorder:
        wait_until(lambda: {picture.frame for picture in recorder.drawn} >= set(range(1, LAST + 1)), "each frame")
    with jet.override():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    shown = check_each(fluid, recorder.drawn[: LAST + 4])
    assert shown >= {8, 12, 16, 20, LAST}
    assert not shown & {1, 2, 3, 4}, "nothing is born before frame 5"


def test_scrubbing_to_and_fro(fluid, jet):
    with recording() as recorder:
        for frame in (12, 20, 6, 2, 15, 9, 24, 1, 18):
            bpy.context.scene.frame_set(frame)
            turns(2)
    assert check_each(fluid, recorder.drawn) >= {12, 20, 15, 9, 24, 18}
    bpy.context.scene.frame_set(14)
    fluid.check_presence("scrubbed", jet)


def test_subframes(fluid, jet):
    with recording() as recorder:
        for subframe in (0.0, 0.25, 0.5, 0.75):
            bpy.context.scene.frame_set(12, subframe=subframe)
            turns(2)
    assert check_each(fluid, recorder.drawn) >= {12.0, 12.25, 12.5, 12.75}
    heights = [np.nonzero(is_bluish(picture.colors).any(axis=1))[0].mean() for picture in recorder.drawn]
    assert heights[-1] > heights[0] + 5, "the particles should have moved between frames"
