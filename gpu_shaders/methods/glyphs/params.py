"""What the method Glyphs is."""

from ....addon.render.method import MethodInfo

METHOD = MethodInfo(
    name="glyphs",
    label="Glyphs",
    description="Spheres and ellipsoids, exactly intersected, on the graphics card",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
    any_kernel=True,
    displays=frozenset({"spheres", "ellipsoids"}),
)
