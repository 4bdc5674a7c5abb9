"""Lays the fluid over a scene that another engine renders, in Blender's compositor."""

from __future__ import annotations

import bpy

from ..fluid.errors import InputError
from .engine_name import ENGINE
from .read_meshes import fluid_replaces_surface

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

_RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
"""By which an engine may see an object."""

_BARE = {"R_LAYERS", "COMPOSITE", "GROUP_OUTPUT", "VIEWER", "FRAME", "REROUTE"}
"""Nodes that change no picture."""

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

    The nodes take the place of the image of the view layer wherever that is used; where the picture is not made of it, they
    come last. Other links stay. The other engine no longer sees objects that are nothing but fluid.

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
        The compositor belongs to another file, or has nodes and is switched off.
    """
    _check(scene)
    fluid = _fluid_scene(scene, view_layer, merge)
    tree = _own_tree(scene)
    scene.render.use_compositing = True
    if merge == "DEPTH":
        view_layer.use_pass_z = fluid.view_layers[view_layer.name].use_pass_z = True
    behind, uses = _place(tree, scene, view_layer)
    frame = tree.nodes.new("NodeFrame")
    frame.label = _FRAME
    layers = _add_node(tree, "CompositorNodeRLayers", frame, behind.node, (0, -420))
    layers.scene, layers.layer = fluid, view_layer.name
    depth = _layer_node(tree, scene, view_layer).outputs["Depth"] if merge == "DEPTH" else None
    result = _add_merge(tree, frame, behind, depth, layers)
    for socket in uses:
        tree.links.new(result, socket)
    for item in _fluid_objects(scene):
        if _is_only_fluid(item) and item.library is None:
            for ray in _RAYS:
                setattr(item, f"visible_{ray}", False)
    return fluid


def drawn_twice(scene: bpy.types.Scene) -> list[str]:
    """Names of the objects that the engine of a scene draws in the place of their fluid."""
    return [item.name for item in _fluid_objects(scene) if item.visible_camera and (_is_only_fluid(item) or _instances(item))]


def _fluid_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The sources of a scene, those in collections that it instances too."""
    instanced = (found for item in scene.objects if item.instance_collection for found in item.instance_collection.all_objects)
    return [item for item in dict.fromkeys((*scene.objects, *instanced)) if item.meniscus.use_fluid]


def _is_only_fluid(item: bpy.types.Object) -> bool:
    """Whether Meniscus shows nothing of a source but its fluid; its emitter may be hidden already."""
    return fluid_replaces_surface(item, item.meniscus) or not item.show_instancer_for_render


def _instances(item: bpy.types.Object) -> bool:
    """Whether particles are drawn as objects."""
    return any(system.settings.render_type in {"OBJECT", "COLLECTION"} for system in item.particle_systems)


def _check(scene: bpy.types.Scene) -> None:
    """Raise InputError where the nodes of the compositor cannot be used as they are."""
    tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group
    if tree is None:
        return
    if tree.library is not None:
        raise InputError(f"The compositor '{tree.name}' is linked from another file: make it local first")
    is_on = scene.render.use_compositing and _tree_of(scene) is not None
    if not is_on and any(node.type not in _BARE for node in tree.nodes):
        raise InputError(
            "The nodes of the compositor are switched off, and would change the picture: switch them on, or remove them"
        )


def _fluid_scene(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, merge: str) -> bpy.types.Scene:
    fluid = scene.copy()
    fluid.name = f"{scene.name} Fluid"
    if bpy.app.version < (5, 0):
        fluid.use_nodes = False
    else:
        fluid.compositing_node_group = None
    # Blender renders all view layers that are in use, also those that no node asks for.
    for layer in fluid.view_layers:
        layer.use = layer.name == view_layer.name
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


def _own_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The nodes of a scene's compositor, which no other scene uses; new ones where it has none."""
    tree = _tree_of(scene)
    if tree is None:
        return _new_tree(scene)
    if bpy.app.version >= (5, 0) and any(other.compositing_node_group == tree for other in bpy.data.scenes if other != scene):
        tree = scene.compositing_node_group = tree.copy()
    return tree


def _place(
    tree: bpy.types.NodeTree, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> tuple[bpy.types.NodeSocket, list[bpy.types.NodeSocket]]:
    """What the fluid is laid over, and the inputs that get the result."""
    output = _output_socket(tree)
    # A link that is muted does nothing, and would be switched on by a new one.
    links = (link for node in _layer_nodes(tree, scene, view_layer) for link in node.outputs["Image"].links)
    uses = [link.to_socket for link in links if not link.is_muted]
    before = _nodes_before(tree, output.node)
    is_seen = any(socket.node in before for socket in uses)
    if output.is_linked and not is_seen:
        return output.links[0].from_socket, [output]
    return _layer_node(tree, scene, view_layer).outputs["Image"], uses if is_seen else [*uses, output]


def _nodes_before(tree: bpy.types.NodeTree, node: bpy.types.Node) -> set[bpy.types.Node]:
    """A node and all that its inputs come from."""
    found: set[bpy.types.Node] = set()
    new = {node}
    while new:
        found |= new
        new = {link.from_node for link in tree.links if link.to_node in new and not link.is_muted} - found
    return found


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


def _layer_nodes(tree: bpy.types.NodeTree, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> list[bpy.types.Node]:
    """The nodes that give the passes of a view layer."""
    layers = (node for node in tree.nodes if node.type == "R_LAYERS" and node.layer == view_layer.name)
    return [node for node in layers if node.scene in (None, scene)]


def _layer_node(tree: bpy.types.NodeTree, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> bpy.types.Node:
    """One that is there, else a new one."""
    for node in _layer_nodes(tree, scene, view_layer):
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
    tree: bpy.types.NodeTree,
    frame: bpy.types.Node,
    behind: bpy.types.NodeSocket,
    depth: bpy.types.NodeSocket | None,
    layers: bpy.types.Node,
) -> bpy.types.NodeSocket:
    """The node that lays fluid over `behind`, by its depth where there is one; its result."""
    if depth is None:
        node = _add_node(tree, "CompositorNodeAlphaOver", frame, behind.node, (320, -120))
        sockets = _sockets(node, _ALPHA_OVER)
    else:
        node = _add_node(tree, "CompositorNodeZcombine", frame, behind.node, (320, -120))
        sockets = _sockets(node, _Z_COMBINE)
        _switch_on(node, "Use Alpha", "use_alpha")
        _switch_on(node, "Anti-Alias", "use_antialias_z")
        tree.links.new(depth, sockets["behind_depth"])
        tree.links.new(layers.outputs["Depth"], sockets["front_depth"])
    tree.links.new(behind, sockets["behind"])
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
