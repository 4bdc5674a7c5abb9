"""Lays the fluid over a scene that another engine renders, in Blender's compositor."""

from __future__ import annotations

import bpy

from ..fluid.errors import InputError
from .engine_name import ENGINE

MERGES = (
    (
        "HOLDOUT",
        "Holdout",
        "Meniscus leaves out the fluid that meshes hide, sample by sample, and the compositor lays it over: smooth borders",
        0,
    ),
    (
        "DEPTH",
        "Depth",
        "The compositor compares depths, pixel by pixel: also hair, volumes and displacement hide fluid, with harder borders",
        1,
    ),
)
"""How fluid and scene are put together, as items of an enumeration."""

_FRAME = "Meniscus"
"""Label of the frame around the nodes that are added."""

# Names of sockets since 5.0, and their identifiers before.
_ALPHA_OVER = {"behind": ("Background", "Image"), "front": ("Foreground", "Image_001")}
_Z_COMBINE = {
    "behind": ("A", "Image"),
    "behind_depth": ("Depth A", "Z"),
    "front": ("B", "Image_001"),
    "front_depth": ("Depth B", "Z_001"),
}


def fluid_scene_of(scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """The scene whose fluid the compositor of a scene lays over; None where it does not."""
    tree = _tree_of(scene)
    layers = (node for node in (tree.nodes if tree is not None else ()) if node.type == "R_LAYERS")
    scenes = (node.scene for node in layers if node.scene is not None and node.scene != scene)
    return next((other for other in scenes if other.render.engine == ENGINE), None)


def add_compositing(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, merge: str) -> bpy.types.Scene:
    """Add a scene that Meniscus renders beside `scene`, and nodes that lay its fluid over the image of a view layer.

    The nodes take the place of the image of the view layer wherever that is used. All else of the compositor stays as it is.

    Parameters
    ----------
    scene, view_layer
        What another engine renders. Where `merge` is "DEPTH" its depth pass is switched on.
    merge
        One of :data:`MERGES`.

    Returns
    -------
    The new scene. It shares objects, collections, world and camera with `scene`.

    Raises
    ------
    InputError
        The compositor belongs to another file.
    """
    tree = _tree_of(scene)
    if tree is not None and tree.library is not None:
        raise InputError(f"The compositor '{tree.name}' is linked from another file: make it local first")
    fluid = _fluid_scene(scene, merge)
    tree = tree if tree is not None else _new_tree(scene)
    scene.render.use_compositing = True
    source = _layer_node(tree, scene, view_layer)
    uses = [link.to_socket for link in source.outputs["Image"].links]
    frame = tree.nodes.new("NodeFrame")
    frame.label = _FRAME
    layers = _add_node(tree, "CompositorNodeRLayers", frame, source, (0, -420))
    layers.scene, layers.layer = fluid, fluid.view_layers[view_layer.name].name
    if merge == "DEPTH":
        view_layer.use_pass_z = fluid.view_layers[view_layer.name].use_pass_z = True
    result = _add_merge(tree, merge, frame, source, layers)
    for socket in uses or [_output_socket(tree)]:
        tree.links.new(result, socket)
    return fluid


def _fluid_scene(scene: bpy.types.Scene, merge: str) -> bpy.types.Scene:
    fluid = scene.copy()
    fluid.name = f"{scene.name} Fluid"
    if bpy.app.version < (5, 0):
        fluid.use_nodes = False
    else:
        fluid.compositing_node_group = None
    fluid.render.engine = ENGINE
    fluid.render.film_transparent = True
    fluid.meniscus.render_style = "material"
    fluid.meniscus.render_meshes = "HOLDOUT" if merge == "HOLDOUT" else "NONE"
    return fluid


def _tree_of(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The nodes of a scene's compositor, where it has some and uses them."""
    if bpy.app.version < (5, 0):
        return scene.node_tree if scene.use_nodes else None
    return scene.compositing_node_group


def _new_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        return scene.node_tree
    tree = bpy.data.node_groups.new(f"{scene.name} Compositing", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    output = tree.nodes.new("NodeGroupOutput")
    output.location = (900, 0)
    return tree


def _layer_node(tree: bpy.types.NodeTree, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> bpy.types.Node:
    """The node that gives the image of a view layer; a new one where there is none."""
    for node in tree.nodes:
        if node.type == "R_LAYERS" and node.scene in (None, scene) and node.layer == view_layer.name:
            return node
    node = tree.nodes.new("CompositorNodeRLayers")
    node.scene, node.layer = scene, view_layer.name
    return node


def _output_socket(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """What becomes the picture."""
    kind, new = ("COMPOSITE", "CompositorNodeComposite") if bpy.app.version < (5, 0) else ("GROUP_OUTPUT", "NodeGroupOutput")
    node = next((node for node in tree.nodes if node.type == kind), None) or tree.nodes.new(new)
    if not any(socket.enabled and socket.type == "RGBA" for socket in node.inputs):
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    return next(socket for socket in node.inputs if socket.enabled and socket.type == "RGBA")


def _add_merge(
    tree: bpy.types.NodeTree, merge: str, frame: bpy.types.Node, source: bpy.types.Node, layers: bpy.types.Node
) -> bpy.types.NodeSocket:
    """The node that lays fluid over the scene; its result."""
    if merge == "HOLDOUT":
        node = _add_node(tree, "CompositorNodeAlphaOver", frame, source, (320, -120))
        sockets = _sockets(node, _ALPHA_OVER)
    else:
        node = _add_node(tree, "CompositorNodeZcombine", frame, source, (320, -120))
        sockets = _sockets(node, _Z_COMBINE)
        _switch_on(node, "Use Alpha", "use_alpha")
        _switch_on(node, "Anti-Alias", "use_antialias_z")
        tree.links.new(source.outputs["Depth"], sockets["behind_depth"])
        tree.links.new(layers.outputs["Depth"], sockets["front_depth"])
    tree.links.new(source.outputs["Image"], sockets["behind"])
    tree.links.new(layers.outputs["Image"], sockets["front"])
    return node.outputs[0]


def _switch_on(node: bpy.types.Node, name: str, attribute: str) -> None:
    """Set a switch of a node that has become a socket."""
    if name in node.inputs:
        node.inputs[name].default_value = True
    else:
        setattr(node, attribute, True)


def _sockets(node: bpy.types.Node, names: dict[str, tuple[str, str]]) -> dict[str, bpy.types.NodeSocket]:
    by_identifier = {socket.identifier: socket for socket in node.inputs}
    return {
        role: by_identifier[identifiers[0]] if identifiers[0] in by_identifier else by_identifier[identifiers[1]]
        for role, identifiers in names.items()
    }


def _add_node(
    tree: bpy.types.NodeTree, kind: str, frame: bpy.types.Node, beside: bpy.types.Node, offset: tuple[float, float]
) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = beside.location.x + offset[0], beside.location.y + offset[1]
    node.parent = frame
    return node
