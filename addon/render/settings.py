"""What users can set of a method, beside what is rendered."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..fluid.errors import InputError

Value = bool | int | float

_SWITCHES = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}
"""How users write them."""


@dataclass(frozen=True)
class Setting:
    """One number or switch of a method.

    Attributes
    ----------
    name, label, description
        The identifier, and what the user interface shows; the description says units.
    default
        A bool, an int or a float: the kind of all its values.
    minimum, maximum
        The range of its values, both ends included; of no meaning for a switch.
    is_for_motion
        Whether it only serves to hold a pace: in Blender it holds while a viewport moves, and nothing else is rendered with it
        unless the command line says so.
    """

    name: str
    label: str
    description: str
    default: Value
    minimum: float = -math.inf
    maximum: float = math.inf
    is_for_motion: bool = False

    def checked(self, value: object) -> Value:
        """The value, of the setting's kind; InputError where it is not, or is out of range."""
        if isinstance(self.default, bool):
            if isinstance(value, bool):
                return value
            raise InputError(f"The setting '{self.name}' is a switch and cannot be {value!r}: give True or False")
        number = self._number(value)
        if not self.minimum <= number <= self.maximum:
            raise InputError(f"The setting '{self.name}' cannot be {number!r}: give {self.range}")
        return number

    def from_text(self, text: str) -> Value:
        """The value that a user has written; the errors are those of :meth:`checked`."""
        if isinstance(self.default, bool):
            return self.checked(_SWITCHES.get(text.strip().lower(), text))
        kind = int if isinstance(self.default, int) else float
        try:
            return self.checked(kind(text))
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            return self.checked(text)

    @property
    def range(self) -> str:
        """What can be given, in words."""
        kind = "a whole number" if isinstance(self.default, int) else "a number"
        if math.isinf(self.maximum):
            return kind if math.isinf(self.minimum) else f"{kind} from {self.minimum:g} up"
        return (
            f"{kind} up to {self.maximum:g}"
            if math.isinf(self.minimum)
            else f"{kind} from {self.minimum:g} to {self.maximum:g}"
        )

    def _number(self, value: object) -> int | float:
        is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
        if isinstance(self.default, int):
            if is_number and isinstance(value, numbers.Integral):
                return int(value)
        elif is_number and isinstance(value, numbers.Real) and math.isfinite(value):
            return float(value)
        raise InputError(f"The setting '{self.name}' cannot be {value!r}: give {self.range}")


def setting_of(method: str, known: Iterable[Setting], name: str) -> Setting:
    """The setting of that name; InputError where the method has none, or is "auto"."""
    if method == "auto":
        raise InputError("Settings belong to one method, and the method is automatic: choose the method too, or leave them out")
    by_name = {setting.name: setting for setting in known}
    if name not in by_name:
        choice = f"it has {', '.join(by_name)}" if by_name else "it has none"
        raise InputError(f"The method '{method}' has no setting '{name}': {choice}")
    return by_name[name]


def checked_settings(method: str, known: Iterable[Setting], given: Mapping[str, object] | None) -> dict[str, Value]:
    """All settings of a method: those that are given, checked, and the defaults of the others.

    Parameters
    ----------
    method
        As the user has named it.
    known, given
        What it has, and what is asked of it by name.

    Raises
    ------
    InputError
        There is no such setting, or it cannot have that value.
    """
    known = tuple(known)
    checked = {name: setting_of(method, known, name).checked(value) for name, value in (given or {}).items()}
    return {**{setting.name: setting.default for setting in known}, **checked}
