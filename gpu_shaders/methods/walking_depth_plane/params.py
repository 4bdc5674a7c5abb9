"""What the method Walking Depth Plane is."""

from __future__ import annotations

from ....addon.render.method import MethodInfo
from ....addon.render.settings import Setting

METHOD = MethodInfo(
    name="walking_depth_plane",
    label="Walking Depth Plane",
    description="Walks a plane of depths to the surface by steps that shorten as the density nears the threshold; takes any "
    "kernel, can hold a time budget, and may miss what is thinner than a step (Mueller et al. 2007)",
    backend="gpu",
    attributes=frozenset({"color", "velocity", "ball"}),
    gl_version=330,
    any_kernel=True,
    settings=(
        Setting(
            "step",
            "Step",
            "The longest step, by the radius that the smallest ball there shows alone; a half takes its influence radius in "
            "four to sixteen steps, longer ones miss more",
            0.5,
            1 / 64,
            2.0,
        ),
        Setting(
            "tolerance",
            "Tolerance",
            "How near to the threshold the density has to come, as a share of it; steps shorten down to the root of this share",
            1e-4,
            1e-8,
            0.25,
        ),
        Setting(
            "refinements",
            "Refinements",
            "How often secants bring the surface nearer in the end; 0 leaves it where the walk has ended",
            1,
            0,
            16,
        ),
        Setting(
            "most_passes",
            "Passes",
            "The walk ends after so many passes of four samples; rays that have not arrived are left out, and counted",
            1024,
            1,
            65536,
        ),
        Setting(
            "finished",
            "Finished",
            "The walk ends when this share of the rays has arrived; the others are left out, and counted",
            1.0,
            0.0,
            1.0,
        ),
        Setting(
            "use_budget",
            "Time Budget",
            "End the walk early while the view changes, so that a picture comes in time; what has not arrived is left out",
            False,
            is_for_motion=True,
        ),
        Setting(
            "budget",
            "Milliseconds",
            "The time that a picture may take, with the budget of time; there is always one pass",
            40.0,
            1.0,
            60000.0,
        ),
    ),
)
