"""What the method Surface Particles is, and what users can set of it."""

from ....addon.render.method import MethodInfo
from ....addon.render.particle_settings import PARTICLE_SETTINGS

METHOD = MethodInfo(
    name="surface_particles",
    label="Surface Particles",
    description="Points that spread over the surface and move with it, drawn as discs, on the graphics card",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
    settings=PARTICLE_SETTINGS,
)
