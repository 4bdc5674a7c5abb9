"""What the method Fitted BVH is."""

from ....addon.render.method import MethodInfo

METHOD = MethodInfo(
    name="fitted_bvh",
    label="Fitted BVH",
    description="Traces rays through a tree of boxes fitted to the balls, which is built first (Gourmel et al. 2010)",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
)
