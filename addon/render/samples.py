"""Where the samples of a pixel lie, for antialiasing."""

from __future__ import annotations


def sample_offset(sample: int) -> tuple[float, float]:
    """Where a sample lies in its pixel, -0.5 to 0.5 from the centre; sample 0 at the centre.

    Halton's sequence: any first samples are spread evenly, and their mean is nearer to the centre than one sample counts.
    """
    return (_mirrored(sample, 2) + 0.5) % 1.0 - 0.5, (_mirrored(sample, 3) + 0.5) % 1.0 - 0.5


def _mirrored(number: int, base: int) -> float:
    """The digits of a number mirrored at the point (van der Corput)."""
    value, unit = 0.0, 1.0
    while number:
        unit /= base
        number, digit = divmod(number, base)
        value += digit * unit
    return value
