"""What the method Vicinity is."""

from ....addon.render.method import MethodInfo
from ....addon.render.settings import Setting

SAMPLES = Setting(
    "samples",
    "Samples",
    "Samples of the density along the diameter of an influence sphere; with few, thin parts of the fluid may be missed",
    default=10,
    minimum=2,
    maximum=1000,
)
BISECTIONS = Setting(
    "bisections",
    "Bisections",
    "How often the step in which the surface lies is halved",
    default=4,
    minimum=0,
    maximum=24,
)
EXACT = Setting(
    "exact",
    "Exact",
    "Find the surface by steps that cannot pass it, instead of samples",
    default=False,
)

METHOD = MethodInfo(
    name="vicinity",
    label="Vicinity",
    description="Samples each ball's influence sphere with a list of the balls that reach into it (Mueller et al. 2007)",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
    any_kernel=True,
    settings=(SAMPLES, BISECTIONS, EXACT),
)
