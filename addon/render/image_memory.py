"""Memory of images that nobody holds any more, kept for the next ones."""

from __future__ import annotations

import math
import weakref
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Element = TypeVar("Element", np.float32, np.int32, np.bool_)

_Block = npt.NDArray[np.uint8]


class ImageMemory:
    """Gives memory to images, and takes it back when the last array that shows it is gone: on any thread.

    To get fresh memory from the system takes longer than to fill it. Kept is only what was in use at once, by images of the
    height and width that were asked for last.
    """

    def __init__(self) -> None:
        self._size: tuple[int, ...] = ()
        self._spare: dict[int, list[_Block]] = {}

    def empty(self, shape: tuple[int, ...], dtype: type[Element]) -> npt.NDArray[Element]:
        """An array (height, width, ...) with whatever numbers."""
        if shape[:2] != self._size:
            self._size, self._spare = shape[:2], {}
        count = math.prod(shape) * np.dtype(dtype).itemsize
        spare = self._spare.setdefault(count, [])
        try:
            block = spare.pop()
        except IndexError:
            block = np.empty(count, np.uint8)
        # Not a view of the block: all views of this array keep it, and not the block behind it, alive.
        whole = np.frombuffer(memoryview(block), dtype)
        # The list may by then be one that images of another size have replaced: both go.
        weakref.finalize(whole, spare.append, block).atexit = False
        return whole.reshape(shape)
