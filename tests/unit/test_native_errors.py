"""The native core as the rest of the package sees it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import meniscus
from meniscus.addon.fluid.errors import DeviceError, InputError
from meniscus.addon.render import native


def test_a_missing_native_core_is_said_in_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "meniscus_native", None)
    with pytest.raises(DeviceError, match=r"native core cannot be loaded \(.*\): install the extension for your system"):
        meniscus.oracle.cast(meniscus.Balls([[0, 0, 0]], 1.0), meniscus.Field(), np.zeros((1, 3)), np.ones((1, 3)))


@pytest.mark.parametrize(
    ("raised", "expected"),
    [
        (ValueError("radii are missing"), InputError),
        (MemoryError("too many balls"), DeviceError),
        (DeviceError("no core"), DeviceError),
        (RuntimeError("a defect"), RuntimeError),
    ],
)
def test_errors_keep_their_sentence(raised, expected):
    with pytest.raises(expected, match=str(raised)) as caught, native.translated_errors():
        raise raised
    assert caught.type is expected


def test_an_input_error_is_passed_on_as_it_is():
    original = InputError("bad")
    with pytest.raises(InputError) as caught, native.translated_errors():
        raise original
    assert caught.value is original
