"""The fluid is where the oracle says, at each pixel: beside meshes, in each kind of viewport."""

import bpy
import numpy as np
import pytest
from event_loop import turns
from expected import box
from fluid_scenes import add_points
from fluid_views import is_compared
from mathutils import Euler
from viewports import Viewport, look, make_plain

CUBE = box((0, 0, 0), 1.0)
RING = [(1.6 * np.cos(a), 1.6 * np.sin(a), 0.4 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 16, endpoint=False)]


@pytest.fixture
def ring(new_file, fluid):
    """The first viewport, with a ring of fluid that goes through the cube of a new file."""
    shown = fluid.prepare()
    add_points(bpy.context.scene.collection, points=RING, radius=0.9)
    look(shown.view, Euler((1.0, 0.2, 0.5)).to_quaternion(), 9.0)
    return shown


@pytest.mark.parametrize("perspective", ["PERSP", "ORTHO"])
def test_fluid_and_meshes_hide_each_other(fluid, ring, perspective):
    look(ring.view, Euler((1.0, 0.2, 0.5)).to_quaternion(), 9.0, perspective=perspective)
    fluid.check_exactly(f"ring_{perspective}", ring, [CUBE])


@pytest.mark.parametrize("shading", ["MATERIAL", "RENDERED"])
def test_fluid_and_meshes_hide_each_other_in_eevee(fluid, ring, shading):
    bpy.context.scene.eevee.taa_samples = 1
    ring.space.shading.type = shading
    fluid.wait_for_meshes(ring, [CUBE])
    fluid.check_presence(f"ring_{shading}", ring, [CUBE])


def test_orbiting(fluid, ring):
    for number, angle in enumerate(np.linspace(0, 3, 4)):
        for step in np.linspace(0, 0.3, 6):
            look(ring.view, Euler((0.8, 0, angle + step)).to_quaternion(), 9.0)
            turns()
        fluid.check_presence(f"orbit_{number}", ring, [CUBE])


def test_quad_view(fluid, ring):
    with ring.override():
        bpy.ops.screen.region_quadview()
    turns(3)
    for index in range(4):
        fluid.check_presence(f"quad_{index}", Viewport(view_index=index), [CUBE])


def test_camera_view_with_shift(fluid, ring):
    bpy.context.scene.camera.data.shift_x = 0.1
    ring.view.view_perspective = "CAMERA"
    fluid.check_presence("camera", ring, [CUBE])


def test_local_view_shows_only_its_own_fluid(fluid, ring):
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    with ring.override():
        bpy.ops.object.select_all(action="DESELECT")
        bpy.data.objects["Cube"].select_set(True)
        bpy.ops.view3d.localview(frame_selected=False)
    fluid.check_absence("local_cube", ring)
    with ring.override():
        bpy.ops.view3d.localview(frame_selected=False)
    fluid.check_presence("local_ended", ring, [CUBE])


def test_a_split_area_and_a_second_window(fluid, ring):
    with ring.override():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.4)
    turns(3)
    second = Viewport(area_index=1)
    look(second.view, Euler((0.3, 0, 0)).to_quaternion(), 7.0)
    fluid.check_presence("split_first", ring, [CUBE])
    fluid.check_presence("split_second", second, [CUBE])
    with ring.override():
        bpy.ops.wm.window_new()
    turns(3)
    other = Viewport(window_index=1)
    make_plain(other.space)
    look(other.view, Euler((0.9, 0, 1)).to_quaternion(), 8.0)
    fluid.check_presence("second_window", other, [CUBE])
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[1]):
        bpy.ops.wm.window_close()
    fluid.check_presence("first_window_again", ring, [CUBE])


def test_the_render_engine_draws_its_own_viewport(fluid, ring):
    """With fluid, meshes and the world; what is hidden in renders hides nothing there."""
    scene = bpy.context.scene
    scene.render.engine, scene.meniscus.render_style = "MENISCUS", "flat"
    bpy.ops.mesh.primitive_cube_add(size=8)
    hidden = bpy.context.object
    hidden.hide_render, hidden.display_type = True, "BOUNDS"
    hidden.select_set(False)
    ring.space.overlay.show_overlays = False
    ring.space.shading.type = "RENDERED"
    fluid.check_presence("ring_engine", ring, [CUBE])
    scene.meniscus.render_meshes = "NONE"
    fluid.check_presence("ring_engine_alone", ring)


def test_a_rendered_viewport_traces_light(fluid, ring):
    """Fluid casts shadows on meshes, before an image of the world, and stays where it is."""
    scene = bpy.context.scene
    scene.render.engine, scene.meniscus.use_tracing = "MENISCUS", True
    scene.meniscus.preview_samples = 3
    scene.objects["Light"].location, scene.objects["Light"].data.energy = (3, -7, 0.5), 3000
    scene.objects["Light"].data.shadow_soft_size = 0.0
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.new("Sky", 4, 2, float_buffer=True)
    texture.image.pixels.foreach_set(np.tile(np.float32((0.02, 0.1, 0.02, 1)), 8))
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    ring.space.shading.type = "RENDERED"
    shadowed = fluid.settled(ring).astype(int)
    labels = fluid.labels(ring, [CUBE])
    scene.meniscus.use_tracing_shadows = False
    lit = fluid.settled(ring).astype(int)
    cube, inner = labels == 1, is_compared(lit, labels)
    darker = (lit - shadowed).max(axis=2) > 20
    assert (lit >= shadowed - 3)[inner].all()
    assert 0.02 < darker[cube & inner].mean() < 0.9
    assert not darker[(labels == -1) & inner].any()
    green = shadowed[(labels == -1) & inner]
    assert (green[:, 1] > green[:, 0] + 20).all()
    scene.meniscus.use_preview_tracing = False
    scene.meniscus.use_tracing_shadows = True
    plain = fluid.settled(ring).astype(int)
    assert ((plain - shadowed).max(axis=2) > 20)[darker & cube & inner].mean() > 0.9
