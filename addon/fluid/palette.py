"""Colours that tell numbered things apart."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]

UNNUMBERED = (0.18, 0.18, 0.18)
"""Linear Rec.709: a grey for what belongs to none."""

_FIRST = ("0072B2", "E69F00", "009E73", "CC79A7", "56B4E9", "D55E00", "F0E442")
"""sRGB: the colours of Okabe and Ito 2008, which colour-blind people tell apart; without black."""

_PLASTIC = 1.324717957244746
"""The real root of x^3 = x + 1: its powers spread points over a square evenly (Roberts 2018, the sequence R2)."""

_LIGHTNESS, _CHROMA = (0.50, 0.86), 0.11
"""Of further colours, in Oklab (Ottosson 2020): from dark to light, and a chroma that nearly all hues have at these."""

_LMS_FROM_OKLAB = ((1.0, 0.3963377774, 0.2158037573), (1.0, -0.1055613458, -0.0638541728), (1.0, -0.0894841775, -1.2914855480))
_RGB_FROM_LMS = (
    (4.0767416621, -3.3077115913, 0.2309699292),
    (-1.2684380046, 2.6097574011, -0.3413193965),
    (-0.0041960863, -0.7034186147, 1.7076147010),
)


def numbered_colors(numbers: npt.NDArray[np.integer]) -> FloatArray:
    """A colour for each number, always the same: neighbouring numbers differ in hue and in lightness.

    Parameters
    ----------
    numbers
        (N,) whole numbers: 0 for what belongs to none, else 1 and more.

    Returns
    -------
    (N, 3) float32, linear Rec.709, each channel from 0 to 1.
    """
    values, which = np.unique(numbers, return_inverse=True)
    first = np.concatenate([[UNNUMBERED], _linear(_FIRST)])
    colors = np.where((values < len(first))[:, None], first[np.minimum(values, len(first) - 1)], _spread_colors(values))
    return np.asarray(colors[which.reshape(-1)], np.float32)


def _spread_colors(numbers: npt.NDArray[np.integer]) -> npt.NDArray[np.float64]:
    """(N, 3) linear Rec.709: hue and lightness by a sequence that never repeats and leaves no large gap."""
    steps = numbers[:, None] / np.array([_PLASTIC, _PLASTIC**2]) % 1
    angle, lightness = 2 * np.pi * steps[:, 0], _LIGHTNESS[0] + (_LIGHTNESS[1] - _LIGHTNESS[0]) * steps[:, 1]
    oklab = np.stack([lightness, _CHROMA * np.cos(angle), _CHROMA * np.sin(angle)], axis=1)
    rgb = (oklab @ np.array(_LMS_FROM_OKLAB).T) ** 3 @ np.array(_RGB_FROM_LMS).T
    return np.asarray(np.clip(rgb, 0, 1))


def _linear(codes: tuple[str, ...]) -> npt.NDArray[np.float64]:
    """(N, 3) linear Rec.709 of colours written as web pages write them."""
    encoded = np.array([[int(code[place : place + 2], 16) / 255 for place in (0, 2, 4)] for code in codes])
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
