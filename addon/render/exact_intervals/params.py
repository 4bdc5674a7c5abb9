"""What the method Exact Intervals is."""

from ..method import MethodInfo

METHOD = MethodInfo(
    name="exact_intervals",
    label="Exact Intervals",
    description="Every interval of every ray in double precision; slow, needs no graphics hardware",
    backend="cpu",
)
