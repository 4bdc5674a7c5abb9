"""What the method Disc Caster is, and what users can set of it."""

from ..method import MethodInfo
from ..particle_settings import PARTICLE_SETTINGS

METHOD = MethodInfo(
    name="disc_caster",
    label="Disc Caster",
    description="Surface Particles on all processor cores; needs no graphics hardware",
    backend="cpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    settings=PARTICLE_SETTINGS,
)
