"""What the method Depth Peeling is."""

from ....addon.render.method import MethodInfo

# A crossing's number, 1 + the ball's, has 24 bits beside the list's length, the phase and the side; see state.glsl.
MAX_BALLS = 2**24 - 1

METHOD = MethodInfo(
    name="depth_peeling",
    label="Depth Peeling",
    description="Peels the influence spheres front to back and clips each interval's polynomial (Kanamori et al. 2008)",
    backend="gpu",
    attributes=frozenset({"color"}),
    gl_version=330,
)
