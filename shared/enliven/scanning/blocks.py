"""A spatial hash table of sparse voxel blocks (8 x 8 x 8 voxels each), with the neighbours of each block."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Int, Int32
from enliven.kernels import njit

SIDE = 8
"""Number of voxels along a block's side. With 8 voxels the table stays small, and a block is as wide as the
truncation band."""
VOXELS = SIDE**3
"""Number of voxels in a block. Voxel (x, y, z) of a block has the index x + 8 y + 64 z."""
_INITIAL_CAPACITY_BLOCKS = 1024
"""Initial capacity of a table, in blocks (4 MB of voxels)."""
_CAPACITY_GROWTH = 1.5
"""Growth factor of the capacity of a full table. At most a third of its memory is then unused."""
_MAX_BLOCK_COORDINATE = 1 << 20
"""Maximum block coordinate that a key can represent, in each direction from the origin: 30 km at 4 mm."""
_MAX_LOAD_FACTOR = 0.5
"""Maximum load factor of the hash table. A search then probes two slots on average."""


class BlockTable:
    """The positions of blocks, numbered in the order in which they were added.

    Attributes:
        count: the number of blocks.
        places: (C, 3) int32 positions of the blocks, in blocks from the origin; only the first ``count`` rows
            are used.
        neighbour_blocks: (C, 8) int32 numbers of the next blocks in positive directions. Column 1 is the
            neighbour along +x, 2 along +y and 4 along +z; diagonal neighbours have the sum, for example 3
            for +x +y. Column 0 is the block's own number. -1 marks a missing neighbour.
    """

    def __init__(self) -> None:
        self.count = 0
        self.places: Int32 = np.zeros((_INITIAL_CAPACITY_BLOCKS, 3), np.int32)
        self.neighbour_blocks: Int32 = np.full((_INITIAL_CAPACITY_BLOCKS, 8), -1, np.int32)
        self.keys: Int = np.full(2 * _INITIAL_CAPACITY_BLOCKS, -1, np.int64)
        self.slots: Int32 = np.full(2 * _INITIAL_CAPACITY_BLOCKS, -1, np.int32)

    @property
    def capacity(self) -> int:
        """Number of blocks that fit into the table."""
        return len(self.places)

    def grow(self) -> None:
        """Enlarges the table by the factor ``_CAPACITY_GROWTH``."""
        capacity = int(self.capacity * _CAPACITY_GROWTH)
        self.places = grow_array(self.places, capacity, 0)
        self.neighbour_blocks = grow_array(self.neighbour_blocks, capacity, -1)
        if capacity > _MAX_LOAD_FACTOR * len(self.keys):
            self._rebuild_hash_table(2 * len(self.keys))

    def keep_blocks(self, numbers: Int) -> None:
        """Keeps only the blocks with these ``numbers`` (K,), and renumbers them from 0 to K - 1."""
        self.places[: len(numbers)] = self.places[numbers]
        self.count = len(numbers)
        self._rebuild_hash_table(len(self.keys))
        self.neighbour_blocks[:] = -1
        link_neighbours(self.keys, self.slots, self.places, self.neighbour_blocks, 0, self.count)

    def find(self, places: Int32) -> Int32:
        """Returns (N,) int32 numbers of the blocks at (N, 3) positions, -1 for a missing block."""
        numbers = np.empty(len(places), np.int32)
        _find_all(self.keys, self.slots, np.asarray(places, np.int32), numbers)
        return numbers

    def _rebuild_hash_table(self, size: int) -> None:
        self.keys, self.slots = np.full(size, -1, np.int64), np.full(size, -1, np.int32)
        _insert_all(self.keys, self.slots, self.places, self.count)


def grow_array(array: np.ndarray, length: int, fill: float) -> np.ndarray:
    """Returns the array with ``length`` rows. New rows are filled with ``fill``."""
    larger = np.full((length, *array.shape[1:]), fill, array.dtype)
    larger[: len(array)] = array
    return larger


@njit(cache=True, nogil=True, forceinline=True)
def key_of(x, y, z):
    """Returns the hash key of a block's position (x, y, z), in blocks."""
    return (
        ((np.int64(x) + _MAX_BLOCK_COORDINATE) << 42)
        | ((np.int64(y) + _MAX_BLOCK_COORDINATE) << 21)
        | (np.int64(z) + _MAX_BLOCK_COORDINATE)
    )


@njit(cache=True, nogil=True, forceinline=True)
def _initial_slot(key, size):
    """Returns the slot at which the search for a key begins, in a table with ``size`` slots (a power of
    two).
    """
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((mixed >> np.uint64(32)) & np.uint64(size - 1))


@njit(cache=True, nogil=True)
def find(keys, slots, key):
    """Returns the number of the block with a key, or -1 if no block has this key."""
    at = _initial_slot(key, len(keys))
    while keys[at] != -1:
        if keys[at] == key:
            return slots[at]
        at = (at + 1) & (len(keys) - 1)
    return np.int32(-1)


@njit(cache=True, nogil=True)
def insert(keys, slots, key, number):
    """Stores the block number of a key that is not in the table yet."""
    at = _initial_slot(key, len(keys))
    while keys[at] != -1:
        at = (at + 1) & (len(keys) - 1)
    keys[at], slots[at] = key, number


@njit(cache=True, nogil=True)
def link_neighbours(keys, slots, places, neighbour_blocks, first, last):
    """Stores the neighbours of the blocks ``first`` to ``last``, and these blocks as the neighbours of their
    neighbours."""
    for b in range(first, last):
        x, y, z = places[b, 0], places[b, 1], places[b, 2]
        for k in range(8):
            dx, dy, dz = k & 1, (k >> 1) & 1, k >> 2
            neighbour_blocks[b, k] = find(keys, slots, key_of(x + dx, y + dy, z + dz))
            before = find(keys, slots, key_of(x - dx, y - dy, z - dz))
            if before >= 0:
                neighbour_blocks[before, k] = b


@njit(cache=True, nogil=True)
def _insert_all(keys, slots, places, count):
    for b in range(count):
        insert(keys, slots, key_of(places[b, 0], places[b, 1], places[b, 2]), b)


@njit(cache=True, nogil=True)
def _find_all(keys, slots, places, found):
    for i in range(len(places)):
        found[i] = find(keys, slots, key_of(places[i, 0], places[i, 1], places[i, 2]))
