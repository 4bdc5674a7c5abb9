"""Foam: bubbles on the dam break, which Geometry Nodes make of Meniscus' surface particles.

``python -m meniscus.samples.foam`` bakes the simulation (once), adds surface particles with a tree of nodes that makes bubbles
of those which move fast, and lets Meniscus render water and foam to out/foam.png; ``blender --background --python`` does it in
any Blender. ``--blend FILE`` also saves the scene, to look at the nodes.
"""

from __future__ import annotations

from pathlib import Path

from . import composite, glass, scene_parts
from .one_thread import bpy

PICTURE = Path(__file__).resolve().parents[1] / "out" / "foam.png"

COUNT = 150_000
"""Surface particles."""
LEAD = 5
"""Frames that the particles follow the water before the picture."""
EYE, TARGET = (4.7, -3.5, 2.3), (2.35, 0.55, 0.45)
"""A camera that looks at the splash, Blender units."""
SLOW, FAST = 1.0, 4.0
"""Speeds, Blender units a second: no particle is a bubble below the first, as many as there may be above the second."""
SHARE = 0.9
"""Of the particles that are bubbles where the water is fast."""
STEEP, FLAT = -0.2, 0.5
"""Heights of the normal: below the first, as against the tank's walls, there is no foam, above the second all that may be."""
SIZES = (0.002, 0.008)
"""Radii of the least and the greatest bubble, Blender units; most are small."""


def main(arguments: list[str] | None = None) -> int:
    """Make the picture; the exit status is 0 only if it was written."""
    parser = composite.picture_parser("Render the dam break with foam.", PICTURE, samples=32)
    parser.add_argument("--blend", default="", metavar="FILE", help="where to save the scene, too")
    options = parser.parse_args(arguments)

    def render_and_save(scene: bpy.types.Scene, path: Path, frame: int, samples: int) -> None:
        render(scene, path, frame, samples)
        if options.blend:
            scene_parts.save_blend(Path(options.blend).absolute())

    return composite.make_picture(options, furnish, render_and_save)


def furnish(scene: bpy.types.Scene, count: int = COUNT) -> None:
    """Give a scene with the dam break surroundings, clear water and foam."""
    glass.furnish(scene)
    scene_parts.add_camera(scene, EYE, TARGET, lens=42.0)
    scene.frame_set(scene.frame_start)
    add_foam(scene, count)


def render(scene: bpy.types.Scene, path: Path, frame: int, samples: int) -> None:
    """Render a frame, up to which particles follow the water, to a PNG picture; RuntimeError says why it cannot be done."""
    for before in range(max(frame - LEAD, scene.frame_start), frame):
        scene.frame_set(before)
    glass.render(scene, path, frame, samples)


def add_foam(scene: bpy.types.Scene, count: int = COUNT) -> bpy.types.Object:
    """Surface particles of the scene's fluid, which is open, and the nodes that make bubbles of them."""
    bpy.ops.meniscus.surface_particles_add(particles=count)
    foam = next(item for item in scene.objects if item.type == "MESH" and item.data.meniscus.use_surface_particles)
    foam.name = "Foam"
    foam.modifiers.new("Foam", "NODES").node_group = foam_nodes(_bubble_material())
    return foam


def foam_nodes(material: bpy.types.Material) -> bpy.types.NodeTree:
    """A Geometry Nodes tree that puts a bubble on some points, more where they are fast.

    Chance and size are random by the point's id, so that a bubble stays what it is from frame to frame.
    """
    tree = _Tree("Foam")
    speed = tree.node("ShaderNodeVectorMath", operation="LENGTH", Vector=tree.attribute("velocity"))
    chance = tree.node(
        "ShaderNodeMapRange",
        interpolation_type="SMOOTHSTEP",
        Value=speed["Value"],
        **{"From Min": SLOW, "From Max": FAST, "To Min": 0.0, "To Max": SHARE},
    )
    height = tree.node("ShaderNodeSeparateXYZ", Vector=tree.attribute("surface_normal"))
    openness = tree.node(
        "ShaderNodeMapRange", interpolation_type="SMOOTHSTEP", Value=height["Z"], **{"From Min": STEEP, "From Max": FLAT}
    )
    both = tree.node("ShaderNodeMath", operation="MULTIPLY", Value=chance["Result"])
    tree.group.links.new(openness["Result"], both.node.inputs[1])
    drawn = tree.node("FunctionNodeRandomValue", Seed=0)
    is_bubble = tree.node("FunctionNodeCompare", operation="LESS_THAN", A=drawn["Value"], B=both["Value"])
    # Cubes of even numbers: many small bubbles, few large ones.
    evenly = tree.node("FunctionNodeRandomValue", Seed=1)
    cubed = tree.node("ShaderNodeMath", operation="POWER", Value=evenly["Value"])
    cubed.node.inputs[1].default_value = 3.0
    size = tree.node("ShaderNodeMapRange", Value=cubed["Value"], **{"To Min": SIZES[0], "To Max": SIZES[1]})
    ball = tree.node("GeometryNodeMeshIcoSphere", Radius=1.0, Subdivisions=2)
    instances = tree.node(
        "GeometryNodeInstanceOnPoints",
        Points=tree.points,
        Selection=is_bubble["Result"],
        Instance=ball["Mesh"],
        Scale=size["Result"],
    )
    # One mesh is faster to read than tens of thousands of instances.
    bubbles = tree.node("GeometryNodeRealizeInstances", Geometry=instances["Instances"])
    painted = tree.node("GeometryNodeSetMaterial", Geometry=bubbles["Geometry"], Material=material)
    tree.end(painted["Geometry"])
    return tree.group


class _Tree:
    """A tree of Geometry Nodes that is written down from its beginning to its end.

    Attributes
    ----------
    group
        The tree.
    points
        The geometry that comes in.
    """

    def __init__(self, name: str) -> None:
        self.group = bpy.data.node_groups.new(name, "GeometryNodeTree")
        for way in ("INPUT", "OUTPUT"):
            self.group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        self.points = self.group.nodes.new("NodeGroupInput").outputs[0]

    def node(self, kind: str, **values: object) -> _Node:
        """A new node; `values` are for its properties, and values or links for its inputs."""
        made = _Node(self.group.nodes.new(kind))
        made.node.location = (180.0 * len(self.group.nodes), 0.0)
        for name, value in values.items():
            if hasattr(made.node, name):
                setattr(made.node, name, value)
            elif isinstance(value, bpy.types.NodeSocket):
                self.group.links.new(value, made.entry(name))
            else:
                made.entry(name).default_value = value
        return made

    def attribute(self, name: str) -> bpy.types.NodeSocket:
        """A vector on points."""
        return self.node("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR", Name=name)["Attribute"]

    def end(self, geometry: bpy.types.NodeSocket) -> None:
        """What comes out."""
        self.group.links.new(geometry, self.node("NodeGroupOutput").node.inputs[0])


class _Node:
    """A node, whose sockets are known by their names; of those with one name the one that its type uses counts."""

    def __init__(self, node: bpy.types.Node) -> None:
        self.node = node

    def entry(self, name: str) -> bpy.types.NodeSocket:
        return next(socket for socket in self.node.inputs if socket.name == name and socket.enabled)

    def __getitem__(self, name: str) -> bpy.types.NodeSocket:
        return next(socket for socket in self.node.outputs if socket.name == name and socket.enabled)


def _bubble_material() -> bpy.types.Material:
    material = bpy.data.materials.new("Bubble")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (0.92, 0.95, 0.97, 1.0)
    inputs["Roughness"].default_value = 0.4
    return material


if __name__ == "__main__":
    raise SystemExit(main())
