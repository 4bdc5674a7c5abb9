"""What `make bench-viewport` times in a window; no test, and the tests' runner does not take it for one."""

import json
import os
import time
from pathlib import Path

import addon_utils
import bpy
import gpu
import numpy as np
from blender_fixtures import EXTENSION
from event_loop import turns, wait_until
from fluid_scenes import add_emitter
from mathutils import Euler, Quaternion
from viewports import look

COUNT = 120_000
FRAMES = range(10, 30)
STILL, ORBIT, STOPS = 200, 120, 7


class Clock:
    """Times the extension's handler at each redraw, by a handler before it and one after it."""

    def __init__(self):
        self.spans = []
        self._began = 0.0
        self.ended = 0.0

    def begin(self):
        self._began = time.perf_counter()

    def end(self):
        self.ended = time.perf_counter()
        self.spans.append(self.ended - self._began)


def test_measure(new_file, fluid):
    shown = fluid.prepare()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene = bpy.context.scene
    emitter = add_emitter(scene.collection, count=COUNT, normal_factor=2, factor_random=1, particle_size=0.005, lifetime=500)
    emitter.show_instancer_for_viewport = False
    emitter.particle_systems[0].settings.display_method = "NONE"
    look(shown.view, Euler((1.1, 0, 0.4)).to_quaternion(), 6.0, (0, 0, 1))
    for frame in range(1, FRAMES.stop):
        scene.frame_set(frame)
    clock = Clock()
    results = {"first_image_ms": first_image(fluid, clock)}
    wait_until(fluid.is_at_rest, "the first picture", 60)
    results |= {
        "renderer": f"{gpu.platform.backend_type_get()}, {gpu.platform.renderer_get()}",
        "blender": bpy.app.version_string,
        "size": [shown.region.width, shown.region.height],
        "still_ms": still(shown, clock),
        "full_after_ms": [stop(fluid, shown, clock) for _ in range(STOPS)],
        "frame_ms": [new_frame(fluid, shown, clock, frame) for frame in FRAMES],
        **orbit(fluid, shown, clock),
        "method": fluid.status.info.method,
        "balls": fluid.status.info.counts["balls"],
    }
    Path(os.environ["MENISCUS_PICTURES"], "viewport.json").write_text(json.dumps(results))


def first_image(fluid, clock):
    """Milliseconds from enabling the extension to its first picture."""
    addon_utils.disable(EXTENSION)
    bpy.types.SpaceView3D.draw_handler_add(clock.begin, (), "WINDOW", "POST_VIEW")
    began = time.perf_counter()
    addon_utils.enable(EXTENSION)
    bpy.types.SpaceView3D.draw_handler_add(clock.end, (), "WINDOW", "POST_VIEW")
    for area in bpy.context.window_manager.windows[0].screen.areas:
        area.tag_redraw()

    def has_picture():
        assert not fluid.status.problem, fluid.status.problem
        return bool(fluid.lives() and fluid.lives()[0].pictures)

    wait_until(has_picture, "the first picture")
    return 1e3 * (clock.ended - began)


def still(shown, clock):
    """Milliseconds of the handler while nothing changes, for each redraw."""
    clock.spans.clear()
    shown.redraw(STILL)
    return [1e3 * span for span in clock.spans]


def orbit(fluid, shown, clock):
    """Redraws a second while the view turns, milliseconds of the handler in each, and which part of the pixels there was."""
    turn(shown, 20)
    clock.spans.clear()
    began, parts = time.perf_counter(), []
    for _ in range(ORBIT):
        turn(shown, 1)
        live = fluid.lives()[0]
        parts.append(part_of_pixels(live) if live._is_current() else 0.0)
    seconds = time.perf_counter() - began
    return {
        "orbit_per_second": ORBIT / seconds,
        "orbit_ms": [1e3 * span for span in clock.spans],
        "orbit_parts": parts,
    }


def stop(fluid, shown, clock):
    """Milliseconds from the last turn of the view to a picture of full resolution on the screen."""
    turn(shown, 9)
    began = time.perf_counter()
    turn(shown, 1)
    live = fluid.lives()[0]
    wait_until(lambda: live._is_current() and part_of_pixels(live) == 1 and fluid.shows_newest(), "full resolution")
    ended = clock.ended
    wait_until(fluid.is_at_rest, "antialiasing")
    return 1e3 * (ended - began)


def new_frame(fluid, shown, clock, frame):
    """Milliseconds from a new frame, which Blender has evaluated, to its picture in the viewport."""
    bpy.context.scene.frame_set(frame)
    began = time.perf_counter()
    shown.region.tag_redraw()
    turns()
    live = fluid.lives()[0]
    wait_until(lambda: live._is_current() and fluid.shows_newest(), "the frame's picture")
    return 1e3 * (clock.ended - began)


def turn(shown, count):
    for _ in range(count):
        shown.view.view_rotation = Quaternion((0, 0, 1), 0.02) @ shown.view.view_rotation
        shown.redraw()


def part_of_pixels(live):
    """Size of the newest picture by that of the view's."""
    picture = live.pictures[0]
    return float(np.prod([picture.image.camera.width / picture.view.camera.width] * 2))
