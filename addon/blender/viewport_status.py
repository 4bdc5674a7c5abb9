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
    has_news
        Whether the panels should be drawn anew.
    """

    problem: str = ""
    details: str = ""
    left_out: str = ""
    info: RenderInfo | None = None
    has_news: bool = False

    def report(self, problem: str, details: str) -> None:
        """Say what is wrong; nothing where the sentence is empty."""
        self.has_news |= problem != self.problem
        self.problem, self.details = problem, details

    def show(self, info: RenderInfo, left_out: str) -> None:
        """Say how the newest image came about."""
        self.has_news |= info is not self.info
        self.info, self.left_out = info, left_out

    def clear(self) -> None:
        """Say nothing."""
        self.report("", "")
        self.info, self.left_out = None, ""


STATUS = ViewportStatus()
"""Of all viewports: the newest."""
