"""The native core, and its errors as sentences for the user."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from ..fluid.balls import Balls
from ..fluid.camera import Camera
from ..fluid.errors import DeviceError, InputError, MeniscusError
from ..fluid.field import Field


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


def device() -> str:
    """The processor's architecture, and which of its instructions are used; the errors are those of :func:`load`."""
    with translated_errors():
        return f"CPU ({platform.machine()}), {load().simd_path()}"


def fluid_arguments(balls: Balls, field: Field) -> tuple[Any, ...]:
    """The first arguments of the module's functions and classes; InputError where the kernel is no polynomial."""
    return balls.positions, balls.radii, balls.weights, field.polynomial_kernel.coefficients, field.threshold


def view_arguments(camera: Camera) -> dict[str, Any]:
    """A camera without region, as the module's functions and classes take it by name."""
    right, up, backward = camera.world_from_view[:3, :3].T.tolist()
    window = camera.window
    return {
        "camera_from_world": [right, up, [-number for number in backward]],
        "eye": camera.eye.tolist(),
        "window": [window.left, window.right, window.bottom, window.top],
        "is_perspective": camera.is_perspective,
        "width": camera.width,
        "height": camera.height,
        "clip": [camera.clip_start, camera.clip_end],
    }


def view_tuple(camera: Camera) -> tuple[Any, ...]:
    """A camera without region, as those functions take it that need several."""
    return tuple(view_arguments(camera).values())


def numbers(name: str, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """An array as the module takes it; float64 and C-contiguous ones are not copied.

    Raises
    ------
    InputError
        It is no array of numbers.
    """
    try:
        return np.asarray(values, np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}") from error


def let_interrupt(share_done: float) -> None:
    """Called now and then while the core works, so that Python sees Ctrl-C."""


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
