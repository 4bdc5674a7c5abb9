"""What the method Tile Lists is."""

from ....addon.render.method import MethodInfo

METHOD = MethodInfo(
    name="tile_lists",
    label="Tile Lists",
    description="Culls, sorts and casts in compute shaders: each tile of the image has a list of the balls that it sees",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=430,
)
