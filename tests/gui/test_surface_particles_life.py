"""Surface particles while the user goes on: a bake in the interface, renders beside viewports, undo."""

import importlib

import bpy
import numpy as np
import pytest
from event_loop import turns, wait_until
from fluid_scenes import add_points
from hand import act, needs_hand

LAST = 2000


@pytest.fixture
def clouds(meniscus):
    return importlib.import_module(f"{meniscus.__name__}.addon.blender.surface_particles").CLOUDS


@pytest.fixture
def mesh(new_file, fluid):
    """The surface particles of a fluid that rises."""
    shown = fluid.prepare()
    scene = bpy.context.scene
    item = add_points(scene.collection, "Drop", [(0, 0, 0), (1.0, 0, 0)], radius=1.0)
    for frame, height in ((1, 0.0), (11, 2.0)):
        item.location = (0, 0, height)
        item.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    with shown.override():
        assert bpy.ops.meniscus.surface_particles_add(particles=200) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="Add Surface Particles")
    turns(3)
    yield particles()
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(5)


def particles():
    return bpy.data.meshes["Surface Particles"]


def height():
    data = particles().attributes["position"].data
    found = np.empty(3 * len(data), np.float32)
    data.foreach_get("vector", found)
    return found[2::3].mean()


@pytest.fixture
def bake(mesh, fluid, tmp_path):
    """A bake of many frames that is on its way."""
    mesh.meniscus.bake_folder = str(tmp_path / "cloud")
    with fluid.prepare().override():
        started = bpy.ops.meniscus.surface_particles_bake("EXEC_DEFAULT", frame_start=1, frame_end=LAST)
    assert started == {"RUNNING_MODAL"}
    wait_until(lambda: len(files(tmp_path)) >= 3, "three frames")


def files(folder):
    return list((folder / "cloud").iterdir()) if (folder / "cloud").exists() else []


def test_the_particles_follow_the_viewport(mesh, fluid):
    bpy.context.scene.frame_set(11)
    turns(3)
    assert height() == pytest.approx(2.0, abs=0.1)
    with fluid.prepare().override():
        bpy.data.objects["Drop"].animation_data_clear()
        bpy.data.objects["Drop"].location = (0, 0, 5)
        turns(3)
        assert height() == pytest.approx(5.0, abs=0.1)
        bpy.ops.ed.undo_push(message="Move")
        bpy.data.objects["Drop"].location = (0, 0, 7)
        bpy.ops.ed.undo_push(message="Move")
        turns(3)
        assert height() == pytest.approx(7.0, abs=0.1)
        bpy.ops.ed.undo()
    wait_until(lambda: abs(height() - 5.0) < 0.1, "the particles of before")


def test_the_window_comes_to_rest(mesh, clouds, monkeypatch):
    turns(10)
    looked = []
    refresh = clouds.refresh
    monkeypatch.setattr(clouds, "refresh", lambda *given: looked.append(1) or refresh(*given))
    turns(50)
    assert not looked


def test_a_bake_goes_on_after_undo_and_ends_with_its_file(bake, fluid, tmp_path):
    with fluid.prepare().override():
        assert not bpy.ops.meniscus.surface_particles_bake.poll()
    before = len(files(tmp_path))
    wait_until(lambda: len(files(tmp_path)) >= before + 3, "more frames")
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(5)
    assert files(tmp_path) == []


def test_a_bake_ends_where_its_object_is_removed(bake, tmp_path):
    bpy.data.meshes.remove(particles())
    wait_until(lambda: files(tmp_path) == [], "the end of the files")


@needs_hand
def test_escape_cancels_a_bake(bake, tmp_path):
    act("mousemove", 400, 400, "key", "Escape")
    wait_until(lambda: files(tmp_path) == [], "the end of the files")
    assert particles().meniscus.baked_files == ""
    assert bpy.context.scene.frame_current == 1


def test_a_short_bake_comes_to_its_end(mesh, fluid, tmp_path):
    mesh.meniscus.bake_folder = str(tmp_path / "cloud")
    with fluid.prepare().override():
        bpy.ops.meniscus.surface_particles_bake("EXEC_DEFAULT", frame_start=1, frame_end=11)
    wait_until(lambda: particles().meniscus.baked_files, "the bake")
    assert len(files(tmp_path)) == 11
    bpy.context.scene.frame_set(11)
    assert height() == pytest.approx(2.0, abs=0.1)


def test_a_render_in_the_interface_shows_its_frames_and_leaves_that_of_the_viewport(mesh, fluid, tmp_path):
    scene, heights = bpy.context.scene, []
    assert scene.render.use_lock_interface
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    scene.render.filepath = str(tmp_path / "frame_")
    scene.frame_start, scene.frame_end = 9, 11

    def note(*_):
        heights.append(height())

    bpy.app.handlers.render_post.append(note)
    try:
        with fluid.prepare().override():
            assert bpy.ops.render.render("INVOKE_DEFAULT", animation=True) == {"RUNNING_MODAL"}
        wait_until(lambda: len(heights) == 3 and not bpy.app.is_job_running("RENDER"), "the render", seconds=60)
    finally:
        bpy.app.handlers.render_post.remove(note)
    turns(10)
    assert 1.5 < heights[0] < heights[1] - 0.02 < heights[2] - 0.04
    assert heights[2] == pytest.approx(2.0, abs=0.1)
    wait_until(lambda: abs(height()) < 0.1, "the particles of the viewport's frame")


def test_a_render_shows_what_renders_show_and_the_viewport_its_own(mesh, fluid):
    scene, heights = bpy.context.scene, []
    other = add_points(scene.collection, "Other", [(0, 0, 8), (1.0, 0, 8)], radius=1.0)
    other.hide_render = True
    with fluid.prepare().override():
        bpy.data.objects["Drop"].hide_set(True)
    wait_until(lambda: abs(height() - 8.0) < 0.1, "the particles of the viewport")
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 32, 24

    def note(*_):
        heights.append(height())

    bpy.app.handlers.render_post.append(note)
    try:
        with fluid.prepare().override():
            assert bpy.ops.render.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
        wait_until(lambda: heights and not bpy.app.is_job_running("RENDER"), "the render", seconds=60)
    finally:
        bpy.app.handlers.render_post.remove(note)
    assert heights == [pytest.approx(0.0, abs=0.1)]
    wait_until(lambda: abs(height() - 8.0) < 0.1, "the particles of the viewport")


def test_the_panel_draws(drawn_panels, fluid, new_file):
    shown = fluid.prepare()
    shown.space.show_region_ui = True
    add_points(bpy.context.scene.collection, "Drop", [(0, 0, 0)], radius=1.0)
    with shown.override():
        bpy.ops.meniscus.surface_particles_add(particles=50)
    bpy.context.scene.render.use_lock_interface = False
    properties = next(area for area in shown.window.screen.areas if area.type == "PROPERTIES")
    turns(3)
    properties.spaces.active.context = "DATA"

    def is_drawn():
        properties.tag_redraw()
        return "MENISCUS_PT_particle_data" in drawn_panels

    wait_until(is_drawn, "the panel")
    assert "MENISCUS_PT_data" not in drawn_panels
