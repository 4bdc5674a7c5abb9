"""What a frame needs in the memory of the graphics processor, kept from frame to frame."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from ...storage import Storage
from .programs import CELL_SIZE, LARGE_OCCLUDERS, OCCLUSION_LEVELS, TILE_SHIFTS

SEEN_BYTES = 32
ENTRY_BYTES = 8
COUNT_BYTES = 64
FILL_GROUPS_OFFSET, LONG_GROUPS_OFFSET, LONGEST_GROUPS_OFFSET = 16, 32, 48
_OVERFLOW = 11
"""Which of the counts."""
_TOO_MANY = 1 << 40
_ROOM = 1.25
"""How much larger than needed buffers become, so that the next frame fits as well."""
_LEAST_SEEN = 1 << 14
_LEAST_ENTRIES = 1 << 16


@dataclass(frozen=True)
class Grid:
    """The cells and the tiles of an image of a certain size.

    Attributes
    ----------
    cells
        Columns and rows of the finest cells.
    level_starts
        Where each level of the pyramid begins, and where the last one ends.
    tile_starts, tile_columns
        The same for the levels of tiles, and how many lie across.
    """

    cells: tuple[int, int]
    level_starts: tuple[int, ...]
    tile_starts: tuple[int, ...]
    tile_columns: tuple[int, ...]

    @classmethod
    def of(cls, width: int, height: int) -> Grid:
        """That of an image."""
        cells = -(-width // CELL_SIZE), -(-height // CELL_SIZE)
        levels = (max(cells) - 1).bit_length() + 1
        counts = [_cells_of_level(cells, level) for level in range(levels)]
        tiles = [(-(-width // 2**shift), -(-height // 2**shift)) for shift in TILE_SHIFTS]
        return cls(
            cells,
            tuple(np.cumsum([0, *counts]).tolist()),
            tuple(np.cumsum([0, *(columns * rows for columns, rows in tiles)]).tolist()),
            tuple(columns for columns, _ in tiles),
        )

    @property
    def levels(self) -> int:
        """Of the pyramid."""
        return len(self.level_starts) - 1

    @property
    def tile_count(self) -> int:
        """On all levels."""
        return int(self.tile_starts[-1])

    def block(self) -> npt.NDArray[np.int32]:
        """The uniform block Grid of occlusion.glsl."""
        block = np.zeros((1 + OCCLUSION_LEVELS, 4), np.int32)
        block[0, :3] = *self.cells, self.levels
        block[1 : 1 + self.levels, 0] = self.level_starts[:-1]
        block[1 : 1 + len(TILE_SHIFTS), 1] = self.tile_starts[:-1]
        block[1 : 1 + len(TILE_SHIFTS), 2] = self.tile_columns
        return block


def _cells_of_level(cells: tuple[int, int], level: int) -> int:
    return -(-cells[0] // (1 << level)) * -(-cells[1] // (1 << level))


class Memory:
    """Buffers that grow with what they have to hold.

    Attributes
    ----------
    storage
        What makes them.
    grid
        The image's that they are for.
    """

    def __init__(self, storage: Storage, width: int, height: int) -> None:
        self.storage = storage
        self.grid = grid = Grid.of(width, height)
        self._buffers = {
            3: storage.reserve(4 * grid.level_starts[-1]),
            5: storage.reserve(4 * grid.cells[0] * grid.cells[1]),
            6: storage.reserve(4 * (4 + LARGE_OCCLUDERS)),
            7: storage.reserve(COUNT_BYTES),
            9: storage.reserve(4 * grid.tile_count),
            10: storage.reserve(2 * 4 * grid.tile_count),
        }
        self._grid_block = storage.of(grid.block())
        self._counts_read = storage.reserve(COUNT_BYTES)
        self._reserve(min(_LEAST_SEEN, storage.most(SEEN_BYTES)), min(_LEAST_ENTRIES, storage.most(ENTRY_BYTES)))

    def holds(self, seen: int, entries: int) -> bool:
        """Whether there was room for seen balls, and for entries of lists."""
        return seen <= self.seen_capacity and entries <= self.entry_capacity

    def grow(self, seen: int, entries: int) -> bool:
        """Make room for them, and for some more; False where a shader cannot use so much."""
        most_seen, most_entries = self.storage.most(SEEN_BYTES), self.storage.most(ENTRY_BYTES)
        if seen > most_seen or entries > most_entries:
            return False
        self._reserve(
            min(max(int(_ROOM * seen), self.seen_capacity), most_seen),
            min(max(int(_ROOM * entries), self.entry_capacity), most_entries),
        )
        return True

    def _reserve(self, seen: int, entries: int) -> None:
        self.seen_capacity, self.entry_capacity = seen, entries
        self._known = (0, 0)
        for binding, size in ((8, SEEN_BYTES * seen), (11, ENTRY_BYTES * entries)):
            self._buffers.pop(binding, None)
            self._buffers[binding] = self.storage.reserve(size)

    def know(self, seen: int, balls: int) -> None:
        """Note how many of how many balls the buffer of seen balls has."""
        self._known = (seen, balls)

    def known_among(self, balls: int) -> int:
        """How many balls of the frame before may still be seen; 0 where it had others."""
        seen, before = self._known
        return seen if before == balls else 0

    @property
    def counts(self) -> moderngl.Buffer:
        """The counts of the frame, see seen.glsl."""
        return self._buffers[7]

    def read_counts(self) -> tuple[int, int, int, int]:
        """Seen balls, entries, crowded rays and the longest list; waits for the frame."""
        # From a copy: a buffer that is read may be moved to where the shaders' access is slow.
        self.storage.copy(self.counts, self._counts_read)
        counts = np.frombuffer(self._counts_read.read(), np.uint32).tolist()
        seen, entries, crowded, longest = counts[:4]
        return seen, _TOO_MANY if counts[_OVERFLOW] else entries, crowded, longest

    @property
    def large(self) -> moderngl.Buffer:
        """The large occluders, see large.glsl."""
        return self._buffers[6]

    def begin(self) -> None:
        """Forget the frame before, and bind all buffers."""
        for binding, value in ((3, 0x7F800000), (5, 0), (7, 0), (9, 0)):
            self.storage.fill(self._buffers[binding], value)
        self.forget_large()
        self._grid_block.bind_to_uniform_block(0)
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)

    def forget_large(self) -> None:
        """Forget the large occluders."""
        self.storage.fill(self.large, 0)
