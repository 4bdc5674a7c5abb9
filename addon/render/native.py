"""The native core, and its errors as sentences for the user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..fluid.errors import DeviceError, InputError, MeniscusError


def load() -> Any:
    """The module ``meniscus_native``.

    Raises
    ------
    DeviceError
        It is not installed, or not made for this system.
    """
    try:
        import meniscus_native
    except ImportError as error:
        raise DeviceError(
            f"Meniscus' native core cannot be loaded ({error}): install the extension for your system, or run 'make setup'"
        ) from error
    return meniscus_native


@contextmanager
def translated_errors() -> Iterator[None]:
    """Raise what the native core raises as a `MeniscusError`; a defect of ours stays a RuntimeError.

    Raises
    ------
    InputError
        For a ValueError: an argument is unusable.
    DeviceError
        For a MemoryError.
    """
    try:
        yield
    except MeniscusError:
        raise
    except ValueError as error:
        raise InputError(str(error)) from error
    except MemoryError as error:
        raise DeviceError(str(error)) from error
