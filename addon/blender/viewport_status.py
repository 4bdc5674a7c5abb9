"""What the viewports last said of themselves; the panels show it."""

from __future__ import annotations

from dataclasses import dataclass

from ..fluid.image import RenderInfo


@dataclass
class ViewportStatus:
    """How drawing goes.

    Attributes
    ----------
    problem
        One sentence that says why nothing is drawn and what to do; empty where all is well.
    details
        What to send with a report of the problem, such as the traceback; empty where there is nothing more to say.
    left_out
        One sentence about unusable balls, empty where there were none.
    info
        How the newest image came about; None before the first.
    """

    problem: str = ""
    details: str = ""
    left_out: str = ""
    info: RenderInfo | None = None


STATUS = ViewportStatus()
"""Of all viewports: the newest."""
