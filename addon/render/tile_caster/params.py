"""What the method Tile Caster is."""

from ..method import MethodInfo

METHOD = MethodInfo(
    name="tile_caster",
    label="Tile Caster",
    description="Packets of rays on all processor cores; needs no graphics hardware",
    backend="cpu",
    attributes=frozenset({"color", "velocity", "ball"}),
)
