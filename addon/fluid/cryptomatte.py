"""Cryptomatte: which objects cover a pixel, and how much of it (Friedman and Jones 2015, specification 1.2.0)."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]

LAYER = "CryptoObject"
"""Blender's name for mattes by object."""


def layer_names(levels: int) -> list[str]:
    """Names of the images that hold the mattes of so many objects a pixel: two objects each."""
    return [f"{LAYER}{index:02}" for index in range((levels + 1) // 2)]


@dataclass(frozen=True)
class Cryptomatte:
    """Mattes of one image.

    Attributes
    ----------
    ranks
        (height, width, 2 * levels) float32: number and coverage of the object that covers most of a pixel, then of the next ...
    names
        Of all objects that have a number.
    """

    ranks: FloatArray
    names: tuple[str, ...]

    @property
    def layers(self) -> dict[str, FloatArray]:
        """(height, width, 4) each, by their names: two ranks a layer, as RGBA."""
        names = layer_names(self.ranks.shape[2] // 2)
        return {name: self.ranks[..., 4 * index : 4 * index + 4] for index, name in enumerate(names)}

    def metadata(self, view_layer: str) -> dict[str, str]:
        """What a file's header says of the mattes of a view layer."""
        layer = f"{view_layer}.{LAYER}"
        start = f"cryptomatte/{name_hash(layer):08x}"[: len("cryptomatte/") + 7]
        manifest = {name: f"{float_bits(name_hash(name)):08x}" for name in self.names}
        return {
            f"{start}/name": layer,
            f"{start}/hash": "MurmurHash3_32",
            f"{start}/conversion": "uint32_to_float32",
            f"{start}/manifest": json.dumps(manifest, ensure_ascii=False),
        }


class Coverage:
    """Counts which object each sample of a pixel sees.

    Parameters
    ----------
    levels
        How many objects a pixel can name, 1 or more.
    """

    def __init__(self, levels: int) -> None:
        self._levels = 2 * len(layer_names(levels))
        self._counts: dict[str, npt.NDArray[np.uint16]] = {}
        self._names: dict[str, None] = {}
        self._samples = 0

    def add(self, objects: npt.NDArray[np.int32], names: tuple[str, ...]) -> None:
        """Count one sample: (height, width) indices into `names`, -1 where nothing is seen."""
        self._samples += 1
        self._names.update(dict.fromkeys(names))
        for index in np.flatnonzero(np.bincount(objects.reshape(-1) + 1)[1:]):
            seen = objects == index
            if names[index] in self._counts:
                self._counts[names[index]] += seen
            else:
                self._counts[names[index]] = seen.astype(np.uint16)

    def cryptomatte(self, shape: tuple[int, ...]) -> Cryptomatte:
        """The mattes of what was counted, for an image of the shape (height, width)."""
        ranks = np.zeros((*shape, 2 * self._levels), np.float32)
        if self._counts:
            self._rank(ranks)
        return Cryptomatte(ranks, tuple(self._names))

    def _rank(self, ranks: FloatArray) -> None:
        counts = np.stack(list(self._counts.values()))
        numbers = np.array([float_bits(name_hash(name)) for name in self._counts], np.uint32).view(np.float32)
        order = np.argsort(counts, axis=0, kind="stable")[::-1][: self._levels]
        for level, index in enumerate(order):
            count = np.take_along_axis(counts, index[None], axis=0)[0]
            ranks[..., 2 * level] = np.where(count > 0, numbers[index], 0)
            ranks[..., 2 * level + 1] = count / np.float32(self._samples)


def name_hash(name: str) -> int:
    """MurmurHash3 (x86, 32 bits, seed 0; Appleby 2011) of a name in UTF-8."""
    data = name.encode()
    whole = len(data) & ~3
    value = 0
    for start in range(0, whole, 4):
        value ^= _mixed(int.from_bytes(data[start : start + 4], "little"))
        value = (_rotated(value, 13) * 5 + 0xE6546B64) & 0xFFFFFFFF
    value ^= _mixed(int.from_bytes(data[whole:], "little")) ^ len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value = ((value ^ (value >> shift)) * factor) & 0xFFFFFFFF
    return value ^ (value >> 16)


def float_bits(number: int) -> int:
    """A hash changed so that its bits are a normal float: neither zero nor denormal, infinite or no number."""
    exponent = number >> 23 & 255
    return number ^ (1 << 23) if exponent in (0, 255) else number


def _mixed(word: int) -> int:
    return _rotated(word * 0xCC9E2D51 & 0xFFFFFFFF, 15) * 0x1B873593 & 0xFFFFFFFF


def _rotated(word: int, places: int) -> int:
    return (word << places | word >> (32 - places)) & 0xFFFFFFFF
