"""What the method Equal Interval is."""

from __future__ import annotations

from ....addon.fluid.field import Field
from ....addon.render.method import MethodInfo
from ....addon.render.settings import Setting

GRACE = 64
"""How many times the limit of samples a ray may take with the adaptive interval."""

METHOD = MethodInfo(
    name="equal_interval",
    label="Equal Interval",
    description="Samples the density at equal intervals by blending billboards; takes any kernel, and may miss what is thinner "
    "than the interval (Mishima et al. 2008)",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
    any_kernel=True,
    settings=(
        Setting("samples", "Samples", "How many samples a ray may take; what needs more is left out, and counted", 32, 4, 4096),
        Setting(
            "interval",
            "Interval",
            "Between samples, as a share of the influence radius of the smallest ball there; never more than half the radius "
            "that the ball shows alone",
            0.125,
            1 / 512,
            0.5,
        ),
        Setting(
            "adaptive",
            "Adaptive",
            f"Take shorter intervals where many balls overlap, and up to {GRACE} times the samples where a ray needs them",
            True,
        ),
        Setting(
            "refinements",
            "Refinements",
            "How often a secant brings the surface nearer; 0 shows the samples themselves, more than 1 needs more samples",
            3,
            0,
            16,
        ),
    ),
)


def hidden_density(field: Field, balls: int, interval: float, weight: float = 1.0) -> float:
    """How far the density may rise above the threshold between two samples that are both below, at most.

    Density changes along a ray no faster than the sum of the steepest slopes of the balls that reach there, and between two
    samples it has half an interval to rise and half to fall. A feature whose density exceeds the threshold by more is never
    missed.

    Parameters
    ----------
    balls, weight
        How many reach there, and their weight.
    interval
        As a share of their influence radius.
    """
    return 0.5 * interval * balls * weight * field.density_kernel.steepest_slope
