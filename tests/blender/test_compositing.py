"""The fluid over a scene of Cycles in the compositor: what is in front is seen, at every pixel, and the rest stays as it is."""

import importlib

import bpy
import numpy as np
import pytest
from cycles_depth import set_up_cycles
from exr_files import exr_channels
from fluid_scenes import add_object, add_points, instance_collection

RED, GREEN = (0.8, 0.05, 0.02), (0.02, 0.6, 0.1)


def emitting(color):
    """A material of one colour in any light."""
    material = bpy.data.materials.new("Emitting")
    material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (0, 0, 0, 1)
    node.inputs["Emission Color"].default_value, node.inputs["Emission Strength"].default_value = (*color, 1), 1
    node.inputs["IOR"].default_value = 1.0
    return material


@pytest.fixture
def scene(empty_scene):
    """A green fluid half behind a red cube of Cycles."""
    fluid = add_points(empty_scene.collection, "Fluid", [(-0.4, 0.5, 0), (0.5, 0.3, 0.3), (0.3, -0.9, 0.6)], 1.2)
    fluid.data.materials.append(emitting(GREEN))
    bpy.ops.mesh.primitive_cube_add(size=1.6, rotation=(0.3, 0.4, 0.5))
    bpy.context.object.data.materials.append(emitting(RED))
    camera = add_object(empty_scene.collection, "Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -7, 0), (np.pi / 2, 0, 0)
    empty_scene.camera = camera
    set_up_cycles(empty_scene)
    empty_scene.cycles.samples, empty_scene.cycles.filter_width = 64, 1.0
    empty_scene.cycles.pixel_filter_type = "BOX"
    render = empty_scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 64, 48, 100
    empty_scene.meniscus.render_samples = 64
    # Undo takes back what is behind the last step.
    bpy.ops.ed.undo_push(message="Before")
    return empty_scene


@pytest.fixture
def rendered(scene, tmp_path):
    """(height, width, 4): the picture that F12 gives."""

    def render():
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
        scene.render.filepath = str(tmp_path / "picture.exr")
        assert bpy.ops.render.render(write_still=True, scene=scene.name) == {"FINISHED"}
        channels = exr_channels(scene.render.filepath)
        return np.stack([channels[name] for name in "RGBA"], axis=-1)

    return render


def tree_of(scene):
    return scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group


def reference(meniscus, scene):
    """(height, width, 3): the red cube and the green fluid where each is in front, the mean of 4 x 4 rays a pixel."""
    package = meniscus.__name__
    module = {
        name: importlib.import_module(f"{package}.addon.blender.{name}")
        for name in ("read_camera", "read_scene", "read_meshes")
    }
    backdrops = importlib.import_module(f"{package}.addon.render.backdrop")
    lighting = importlib.import_module(f"{package}.addon.fluid.lighting").Lighting()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera = module["read_camera"].read_camera(depsgraph)
    fluid, meshes = module["read_scene"].read_fluid(depsgraph), module["read_meshes"].read_meshes(depsgraph)
    total = 0
    for x in np.arange(4) / 4 - 0.375:
        for y in np.arange(4) / 4 - 0.375:
            shot = camera.shifted(x, y)
            depth = meniscus.render(fluid.balls, shot, module["read_scene"].read_field(scene), passes=("depth",))["depth"]
            cube = backdrops.backdrop(meshes, shot, lighting, (0, 0, 0, 0)).depth
            nearest = np.where(depth < cube, 1, 0)[..., None] * np.array(GREEN) + np.where(depth > cube, 1, 0)[..., None] * RED
            total = total + nearest / 16
    return total


@pytest.mark.parametrize("merge", ["HOLDOUT", "DEPTH"])
def test_what_is_in_front_is_seen(meniscus, scene, rendered, merge):
    assert bpy.ops.meniscus.add_compositing(merge=merge) == {"FINISHED"}
    picture, expected = rendered()[..., :3], reference(meniscus, scene)
    errors = np.abs(picture - expected).max(axis=2)
    # Away from borders each pixel is one of the colours.
    pure = [np.all(np.isclose(expected, color, atol=1e-6), axis=2) for color in (RED, GREEN, (0, 0, 0))]
    assert all(mask.mean() > 0.03 for mask in pure)
    inner = [np.all([np.roll(mask, (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)], axis=0) for mask in pure]
    assert errors[np.any(inner, axis=0)].max() < 0.02
    if merge == "HOLDOUT":
        # Borders of fluid and cube, where a part of the background shines through what covers only a part of a pixel.
        assert errors.max() < 0.15
        assert errors.mean() < 0.002
    assert errors.mean() < 0.01


def test_nodes_of_the_user_stay(scene):
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        tree = scene.node_tree
        output = next(node for node in tree.nodes if node.type == "COMPOSITE")
    else:
        tree = bpy.data.node_groups.new("Mine", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        output = tree.nodes.new("NodeGroupOutput")
    for node in list(tree.nodes):
        if node != output:
            tree.nodes.remove(node)
    source, blur = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeBlur")
    viewer, mask = tree.nodes.new("CompositorNodeViewer"), tree.nodes.new("CompositorNodeInvert")
    tree.links.new(source.outputs["Image"], blur.inputs["Image"])
    tree.links.new(source.outputs["Alpha"], mask.inputs["Color"])
    tree.links.new(source.outputs["Image"], viewer.inputs[0])
    tree.links.new(blur.outputs[0], output.inputs[0])
    before = {node.name for node in tree.nodes}
    kept = [(blur, output), (source, mask)]
    assert bpy.ops.meniscus.add_compositing() == {"FINISHED"}
    assert before < {node.name for node in tree.nodes}
    links = [(link.from_node.name, link.to_node.name) for link in tree.links]
    for start, end in kept:
        assert (start.name, end.name) in links
    (over,) = (node for node in tree.nodes if node.type == "ALPHAOVER")
    assert {(source.name, over.name), (over.name, blur.name), (over.name, viewer.name)} <= set(links)
    assert (source.name, blur.name) not in links


def test_once_is_enough(scene):
    assert bpy.ops.meniscus.add_compositing() == {"FINISHED"}
    assert not bpy.ops.meniscus.add_compositing.poll()
    count = len(bpy.data.scenes)
    with pytest.raises(RuntimeError, match="lays the fluid of 'Scene Fluid' over this scene already"):
        bpy.ops.meniscus.add_compositing()
    assert len(bpy.data.scenes) == count


def test_the_fluid_scene_is_that_scene(scene):
    scene.meniscus.isovalue, scene.frame_end = 0.37, 77
    bpy.ops.meniscus.add_compositing()
    fluid = bpy.data.scenes["Scene Fluid"]
    assert fluid.render.engine == "MENISCUS"
    assert (fluid.meniscus.isovalue, fluid.frame_end) == (pytest.approx(0.37), 77)
    assert fluid.camera == scene.camera
    assert set(fluid.objects) == set(scene.objects)
    assert scene.render.engine == "CYCLES"
    assert (scene.meniscus.render_meshes, fluid.meniscus.render_meshes) == ("SHADED", "HOLDOUT")


def test_a_resolution_that_changes_later_counts(scene, rendered):
    bpy.ops.meniscus.add_compositing()
    scene.render.resolution_x, scene.render.resolution_y = 80, 40
    picture = rendered()
    assert picture.shape == (40, 80, 4)
    assert np.isclose(picture[..., :3], GREEN, atol=0.02).all(axis=2).sum() > 50


@pytest.mark.parametrize("has_tree", [False, True])
def test_undo_restores_everything(scene, has_tree):
    if has_tree and bpy.app.version >= (5, 0):
        scene.compositing_node_group = bpy.data.node_groups.new("Mine", "CompositorNodeTree")
    elif has_tree:
        scene.use_nodes = True
    bpy.ops.ed.undo_push(message="Set up")
    before = _state()
    assert bpy.ops.meniscus.add_compositing(merge="DEPTH") == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Composite")
    assert _state() != before
    bpy.ops.ed.undo()
    assert _state() == before


def _state():
    scene = bpy.data.scenes["Scene"]
    tree = tree_of(scene)
    return (
        sorted(bpy.data.scenes.keys()),
        sorted(bpy.data.node_groups.keys()),
        scene.view_layers[0].use_pass_z,
        sorted((item.name, item.visible_camera, item.visible_shadow) for item in scene.objects),
        bpy.app.version < (5, 0) and scene.use_nodes,
        sorted(node.name for node in tree.nodes) if tree is not None else None,
        sorted((link.from_node.name, link.to_node.name) for link in tree.links) if tree is not None else None,
    )


def test_why_it_cannot_be_done(scene):
    poll = bpy.ops.meniscus.add_compositing.poll
    assert poll()
    scene.render.engine = "MENISCUS"
    assert not poll()
    scene.render.engine = "CYCLES"
    scene.objects["Fluid"].meniscus.use_fluid = False
    assert not poll()


def test_instances_hide_fluid_too(meniscus, scene, rendered):
    group = bpy.data.collections.new("Group")
    cube = next(item for item in scene.objects if item.type == "MESH" and item.name != "Fluid")
    scene.collection.objects.unlink(cube)
    group.objects.link(cube)
    instance_collection(scene, group)
    bpy.ops.meniscus.add_compositing()
    errors = np.abs(rendered()[..., :3] - reference(meniscus, scene)).max(axis=2)
    assert errors.mean() < 0.01


@pytest.fixture
def tree(scene):
    """The compositor's nodes, of which there is only the output."""
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        scene.node_tree.nodes.clear()
        scene.node_tree.nodes.new("CompositorNodeComposite")
        return scene.node_tree
    tree = bpy.data.node_groups.new("Mine", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    tree.nodes.new("NodeGroupOutput")
    return tree


def linked(tree):
    """The names of the nodes that each link joins."""
    return {(link.from_node.name, link.to_node.name) for link in tree.links}


@pytest.mark.parametrize("has_layer_node", [True, False])
def test_a_picture_that_is_not_made_of_combined_stays_beneath(scene, tree, has_layer_node):
    (output,) = tree.nodes
    blur = tree.nodes.new("CompositorNodeBlur")
    start = tree.nodes.new("CompositorNodeRLayers" if has_layer_node else "CompositorNodeImage")
    tree.links.new(start.outputs["Alpha"], blur.inputs[0])
    tree.links.new(blur.outputs[0], output.inputs[0])
    bpy.ops.meniscus.add_compositing()
    (over,) = (node for node in tree.nodes if node.type == "ALPHAOVER")
    (fluid,) = (node for node in tree.nodes if node.type == "R_LAYERS" and node.scene != scene)
    expected = [(start, blur), (blur, over), (fluid, over), (over, output)]
    assert linked(tree) == {(first.name, second.name) for first, second in expected}
    assert len(tree.nodes) == 6


def test_the_picture_shows_fluid_where_only_a_viewer_did(scene, tree):
    (output,) = tree.nodes
    source, viewer = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeViewer")
    tree.links.new(source.outputs["Image"], viewer.inputs[0])
    bpy.ops.meniscus.add_compositing()
    (over,) = (node for node in tree.nodes if node.type == "ALPHAOVER")
    assert {(over.name, viewer.name), (over.name, output.name)} <= linked(tree)


def test_all_nodes_of_the_view_layer_get_fluid(scene, tree):
    (output,) = tree.nodes
    viewer = tree.nodes.new("CompositorNodeViewer")
    for target in (viewer, output):
        tree.links.new(tree.nodes.new("CompositorNodeRLayers").outputs["Image"], target.inputs[0])
    bpy.ops.meniscus.add_compositing()
    (over,) = (node for node in tree.nodes if node.type == "ALPHAOVER")
    assert {(over.name, viewer.name), (over.name, output.name)} <= linked(tree)


def test_a_muted_link_stays_muted(scene, tree):
    (output,) = tree.nodes
    source, invert = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeInvert")
    tree.links.new(source.outputs["Image"], output.inputs[0])
    tree.links.new(source.outputs["Image"], invert.inputs["Color"]).is_muted = True
    bpy.ops.meniscus.add_compositing()
    (link,) = invert.inputs["Color"].links
    assert (link.from_node, link.is_muted) == (source, True)


def test_nodes_that_are_switched_off_stay_off(scene, tree):
    (output,) = tree.nodes
    source, invert = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeInvert")
    tree.links.new(source.outputs["Image"], invert.inputs["Color"])
    tree.links.new(invert.outputs[0], output.inputs[0])
    scene.render.use_compositing = False
    before = linked(tree)
    with pytest.raises(RuntimeError, match="switched off"):
        bpy.ops.meniscus.add_compositing()
    assert (linked(tree), scene.render.use_compositing, len(bpy.data.scenes)) == (before, False, 1)


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="scenes do not share nodes before 5.0")
def test_scenes_that_share_the_nodes_stay_as_they_are(scene, tree):
    tree.links.new(tree.nodes.new("CompositorNodeRLayers").outputs["Image"], tree.nodes["Group Output"].inputs[0])
    other = scene.copy()
    before = linked(tree)
    bpy.ops.meniscus.add_compositing()
    assert (other.compositing_node_group, linked(tree)) == (tree, before)
    assert any(node.type == "ALPHAOVER" for node in scene.compositing_node_group.nodes)


def test_only_the_view_layer_that_is_used_is_rendered_with_fluid(scene):
    scene.view_layers.new("Extra")
    bpy.ops.meniscus.add_compositing()
    assert [layer.use for layer in scene.view_layers] == [True, True]
    used = [layer.name for layer in bpy.data.scenes["Scene Fluid"].view_layers if layer.use]
    assert used == [bpy.context.view_layer.name]


def add_box_of_points(scene):
    """Vertices that are fluid, with faces between them."""
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(-1, 0, 1.2))
    item = bpy.context.object
    item.meniscus.use_fluid, item.meniscus.source = True, "POINTS"
    item.meniscus.radius_mode, item.meniscus.radius = "FIXED", 0.1
    item.data.materials.append(emitting((0, 0, 1)))


def add_cubes_of_particles(scene):
    """Particles that are fluid, and drawn as cubes; their emitter is hidden."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0, 50, 0))
    cube = bpy.context.object
    cube.data.materials.append(emitting((0, 0, 1)))
    bpy.ops.mesh.primitive_plane_add(size=2, rotation=(np.pi / 2, 0, 0), location=(0, -2, 0))
    item = bpy.context.object
    item.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = item.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.physics_type = 12, 1, 1, "NO"
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", cube, 0.5
    item.show_instancer_for_render = False
    item.meniscus.use_fluid, item.meniscus.source = True, "PARTICLES"
    item.meniscus.radius_mode, item.meniscus.radius = "FIXED", 0.1
    scene.frame_set(2)


@pytest.mark.parametrize("add", [add_box_of_points, add_cubes_of_particles])
def test_what_is_fluid_is_not_drawn_twice(scene, rendered, add):
    add(scene)
    scene.meniscus.render_samples = scene.cycles.samples = 4

    def blue(picture):
        return (picture[..., 2] > 0.5).mean()

    assert blue(rendered()) > 0.03
    bpy.ops.meniscus.add_compositing()
    # All balls that are blue are small.
    assert blue(rendered()) < 0.01


def test_what_is_drawn_twice_is_said(scene, capfd):
    add_cubes_of_particles(scene)
    scene.objects["Plane"].show_instancer_for_render = True
    bpy.ops.meniscus.add_compositing()
    assert scene.objects["Plane"].visible_camera
    assert "still draws 'Plane'" in capfd.readouterr().out
