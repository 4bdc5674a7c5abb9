"""The extension in a Blender that has a window: what it draws, and that it leaves Blender's own drawing alone."""

import bpy
import pytest
from event_loop import wait_until
from expected import is_steady
from pictures import check_same
from viewports import settled, viewport


@pytest.fixture
def emitter(new_file):
    """The active object of a new file, with a particle system and used as fluid."""
    item = bpy.data.objects["Cube"]
    item.modifiers.new("Particles", "PARTICLE_SYSTEM")
    item.meniscus.use_fluid = True
    return item


@pytest.fixture
def properties_editor():
    """The properties editor of the window."""
    screen = bpy.context.window_manager.windows[0].screen
    return next(area for area in screen.areas if area.type == "PROPERTIES")


@pytest.mark.parametrize(
    ("tab", "panel"),
    [
        ("OBJECT", "MENISCUS_PT_object"),
        ("PARTICLES", "MENISCUS_PT_particles"),
        ("DATA", "MENISCUS_PT_data"),
        ("RENDER", "MENISCUS_PT_scene"),
    ],
)
@pytest.mark.parametrize("mode", ["PARTICLE", "ATTRIBUTE", "FIXED"])
def test_panels_draw(drawn_panels, emitter, properties_editor, tab, panel, mode):
    emitter.meniscus.radius_mode = mode
    emitter.meniscus.color_mode = {"PARTICLE": "LOOK"}.get(mode, mode)
    properties_editor.spaces.active.context = tab
    properties_editor.tag_redraw()
    wait_until(lambda: panel in drawn_panels, f"the panel {panel}")


def test_panels_of_the_engine_draw(drawn_panels, emitter, properties_editor):
    bpy.context.scene.render.engine = "MENISCUS"
    for tab, panel in (("RENDER", "MENISCUS_PT_sampling"), ("VIEW_LAYER", "MENISCUS_PT_passes")):
        properties_editor.spaces.active.context = tab
        properties_editor.tag_redraw()
        wait_until(lambda panel=panel: panel in drawn_panels, f"the panel {panel}")


def test_rendering_leaves_the_window_as_it_was(meniscus, emitter):
    shown = viewport()
    before = settled(shown)
    assert before.std() > 10, "the window should show something"
    balls = meniscus.Balls([[0, 0, 0], [0.5, 0, 0]], 1.0)
    camera = meniscus.Camera.perspective((0, -4, 0), (0, 0, 0), width=64, height=48)
    for _ in range(3):
        assert meniscus.render(balls, camera, meniscus.Field(), method="depth_peeling").hit.any()
    shown.redraw(2)
    check_same("rendering", settled(shown), before, is_steady(before), tolerance=0)
