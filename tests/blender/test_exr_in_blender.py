"""EXR files as Blender's own loader and compositor see them."""

import importlib
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest

WIDTH, HEIGHT = 9, 7

needs_parts = pytest.mark.skipif(bpy.app.version < (4, 5), reason="Blender reads only the first part of a file before 4.5")
LAYOUTS = [False, pytest.param(True, marks=needs_parts)]
"""Whether each pass is a part of its own."""


def random_image(meniscus: ModuleType) -> object:
    image_module = importlib.import_module(f"{meniscus.__name__}.addon.fluid.image")
    random = np.random.default_rng(0)
    passes = {
        "combined": random.uniform(0, 2, (HEIGHT, WIDTH, 4)).astype(np.float32),
        "depth": random.uniform(0.1, 100, (HEIGHT, WIDTH)).astype(np.float32),
        "normal": random.uniform(-1, 1, (HEIGHT, WIDTH, 3)).astype(np.float32),
        "position": random.normal(0, 1e3, (HEIGHT, WIDTH, 3)).astype(np.float32),
    }
    passes["depth"][1, 2:5] = 1e10
    camera = meniscus.Camera.perspective((0, -5, 1), (0, 0, 0), width=WIDTH, height=HEIGHT)
    return image_module.ImageBuffers(camera, passes, passes["depth"] < 1e10, image_module.RenderInfo())


def write_in_child(meniscus: ModuleType, path: Path, image: object, **options: object) -> None:
    """In some builds of Blender the OpenEXR package cannot live in the process."""
    exr_process = importlib.import_module(f"{meniscus.__name__}.addon.output.exr_process")
    module = importlib.import_module(f"{meniscus.__name__}.addon.output.exr_content")
    content = module.flat_content(image, module.ExrOptions(**options))
    with exr_process.ExrProcess() as writer:
        writer.write(path, content).result()


def compositor_tree(scene: bpy.types.Scene) -> tuple[bpy.types.NodeTree, bpy.types.Node]:
    """An empty compositor and the node whose input becomes the picture."""
    if bpy.app.version < (5, 0, 0):
        scene.use_nodes = True
        scene.node_tree.nodes.clear()
        return scene.node_tree, scene.node_tree.nodes.new("CompositorNodeComposite")
    tree = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    scene.compositing_node_group = tree
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return tree, tree.nodes.new("NodeGroupOutput")


def pixels_through_compositor(scene: bpy.types.Scene, source: Path, layer: str, result: Path) -> np.ndarray:
    """(height, width, 4) float32 of a layer of `source`, row 0 at the bottom."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    tree, end = compositor_tree(scene)
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(source))
    tree.links.new(node.outputs[layer], end.inputs[0])
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.compositor_precision = "FULL"
    scene.render.filepath = str(result)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(result))
    pixels = np.empty(WIDTH * HEIGHT * 4, np.float32)
    picture.pixels.foreach_get(pixels)
    return pixels.reshape(HEIGHT, WIDTH, 4)


@pytest.mark.parametrize("is_multipart", LAYOUTS)
@pytest.mark.parametrize("layer", ["Combined", "Depth", "Normal", "Position"])
def test_blender_reads_each_pass_bit_for_bit(
    meniscus: ModuleType, empty_scene: bpy.types.Scene, tmp_path: Path, layer: str, is_multipart: bool
) -> None:
    image = random_image(meniscus)
    write_in_child(meniscus, tmp_path / "image.exr", image, is_multipart=is_multipart)
    pixels = pixels_through_compositor(empty_scene, tmp_path / "image.exr", layer, tmp_path / "result.exr")
    expected = image[layer.lower()].reshape(HEIGHT, WIDTH, -1)
    if layer == "Combined":
        expected = expected.astype(np.float16).astype(np.float32)
    assert np.array_equal(pixels[..., : expected.shape[2]], expected)


@pytest.mark.parametrize("is_multipart", LAYOUTS)
def test_blender_offers_every_pass_as_a_layer(
    meniscus: ModuleType, empty_scene: bpy.types.Scene, tmp_path: Path, is_multipart: bool
) -> None:
    write_in_child(meniscus, tmp_path / "image.exr", random_image(meniscus), is_multipart=is_multipart)
    tree, _ = compositor_tree(empty_scene)
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(tmp_path / "image.exr"))
    assert node.image.type == "MULTILAYER"
    assert {output.name for output in node.outputs if output.enabled} - {"Alpha"} == {"Combined", "Depth", "Normal", "Position"}
