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
    notes
        Sentences on what is drawn, but not quite as it should be, such as that unusable balls were left out.
    info
        How the newest image came about; None before the first.
    has_news
        Whether the panels should be drawn anew.
    """

    problem: str = ""
    details: str = ""
    notes: tuple[str, ...] = ()
    info: RenderInfo | None = None
    has_news: bool = False

    def report(self, problem: str, details: str) -> None:
        """Say what is wrong; nothing where the sentence is empty."""
        self.has_news |= problem != self.problem
        self.problem, self.details = problem, details

    def show(self, info: RenderInfo, *notes: str) -> None:
        """Say how the newest image came about."""
        told = tuple(filter(None, notes))
        self.has_news |= info is not self.info or told != self.notes
        self.info, self.notes = info, told

    def clear(self) -> None:
        """Say nothing."""
        self.report("", "")
        self.info, self.notes = None, ()


STATUS = ViewportStatus()
"""Of all viewports: the newest."""
