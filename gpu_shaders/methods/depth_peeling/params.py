"""What the method Depth Peeling is."""

from ....addon.render.method import MethodInfo

# A crossing's number has 25 bits beside the list's length and state: one of two sides of each ball.
MAX_BALLS = 2**24 - 1

METHOD = MethodInfo(
    name="depth_peeling",
    label="Depth Peeling",
    description="Peels the influence spheres front to back and clips each interval's polynomial (Kanamori et al. 2008)",
    backend="gpu",
    attributes=frozenset({"color"}),
    gl_version=330,
)
