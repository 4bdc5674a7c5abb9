"""What the method Glyph Caster is."""

from ..method import MethodInfo

METHOD = MethodInfo(
    name="glyph_caster",
    label="Glyph Caster",
    description="Spheres and ellipsoids on all processor cores; needs no graphics hardware",
    backend="cpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    any_kernel=True,
    displays=frozenset({"spheres", "ellipsoids"}),
)
