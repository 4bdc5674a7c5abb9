"""Which method renders, and how: what Blender's settings say, on its way to the renderer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .registry import method_info
from .settings import Value, setting_of


@dataclass(frozen=True)
class MethodChoice:
    """What :func:`renderer.render` is told of the method.

    Attributes
    ----------
    method, backend, settings
        As there.
    """

    method: str = "auto"
    backend: str = "auto"
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def options(self) -> dict[str, Any]:
        """The arguments of :func:`renderer.render`."""
        return {"method": self.method, "backend": self.backend, "settings": self.settings}

    def with_written(self, texts: Iterable[tuple[str, str]]) -> MethodChoice:
        """The same with other settings, given by name as a user writes them.

        Raises
        ------
        InputError
            The method is automatic or has no such setting, or that cannot have the value.
        """
        known = () if self.method == "auto" else method_info(self.method).settings
        written = {name: setting_of(self.method, known, name).from_text(text) for name, text in texts}
        return replace(self, settings={**self.settings, **written})

    @property
    def unhurried(self) -> MethodChoice:
        """The same, without what only serves to hold a pace."""
        if not self.settings:
            return self
        hurrying = {setting.name for setting in method_info(self.method).settings if setting.is_for_motion}
        return replace(self, settings={name: value for name, value in self.settings.items() if name not in hurrying})
