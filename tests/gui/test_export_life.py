"""An export that runs while the user goes on."""

import bpy
import pytest
from event_loop import turns, wait_until
from fluid_scenes import add_points

EXR_MAGIC = b"\x76\x2f\x31\x01"


@pytest.fixture
def export(new_file, fluid, tmp_path):
    """A viewport, while many frames are exported; each is claimed before it is rendered."""
    shown = fluid.prepare()
    scene = bpy.context.scene
    add_points(scene.collection, "Drop", [(0, 0, 0), (1.5, 0, 0)], radius=1.0)
    scene.frame_end, scene.render.resolution_x, scene.render.resolution_y = 5000, 64, 48
    scene.render.use_overwrite, scene.render.use_placeholder = False, True
    with shown.override():
        bpy.ops.ed.undo_push(message="Before")
        scene.frame_set(7)
        bpy.ops.ed.undo_push(message="Frame")
        assert bpy.ops.meniscus.export_passes("EXEC_DEFAULT", filepath=str(tmp_path / "####.exr")) == {"RUNNING_MODAL"}
    wait_until(lambda: len(files(tmp_path)) >= 3, "three frames")
    yield shown
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    turns(5)  # Blender 4.3 crashes where it quits before the new file was drawn


def files(folder):
    return [path for path in folder.iterdir() if not path.name.startswith(".")]


def are_whole(folder):
    return all(path.read_bytes()[:4] == EXR_MAGIC for path in files(folder))


def test_it_goes_on_after_undo(export, tmp_path):
    with export.override():
        assert bpy.ops.ed.undo() == {"FINISHED"}
    before = len(files(tmp_path))
    wait_until(lambda: len(files(tmp_path)) >= before + 5, "more frames")
    assert not bpy.ops.meniscus.export_passes.poll()


def test_it_ends_where_its_scene_is_removed(export, tmp_path):
    old = bpy.context.scene
    with export.override():
        export.window.scene = bpy.data.scenes.new("Other")
        bpy.data.scenes.remove(old)
    wait_until(lambda: are_whole(tmp_path), "the end of the claims")
    turns(30)
    assert are_whole(tmp_path)
    assert 3 <= len(files(tmp_path)) < 5000
