"""Blocks of 8 x 8 x 8 voxels by their place: a hash table, and the neighbours of each block."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Int, Int32
from enliven.kernels import njit

SIDE = 8
"""Voxels of a block's side: the table stays small, and a block is as wide as the band that it holds."""
VOXELS = SIDE**3
"""Voxels of a block; voxel (x, y, z) of it is number x + 8 y + 64 z."""
_FIRST = 1024
"""Blocks that a table begins with: 4 MB of voxels."""
_GROWTH = 1.5
"""Factor by which a full table grows: a third of the memory at most is not yet used."""
_REACH = 1 << 20
"""Blocks to each side of the origin that a key can tell apart: 30 km at 4 mm."""
_FULL = 0.5
"""Share of the hash table that is filled at most: a search then looks at two places on average."""


class BlockTable:
    """The places of blocks, numbered in the order in which they came.

    Attributes:
        count: the number of blocks.
        places: (C, 3) int32 in blocks from the origin, of which the first ``count`` are used.
        beside: (C, 8) int32 the block that lies one further along x, y and z, at the sum of 1, 2 and 4 for
            these; itself at 0, -1 where there is none.
    """

    def __init__(self) -> None:
        self.count = 0
        self.places: Int32 = np.zeros((_FIRST, 3), np.int32)
        self.beside: Int32 = np.full((_FIRST, 8), -1, np.int32)
        self.keys: Int = np.full(2 * _FIRST, -1, np.int64)
        self.slots: Int32 = np.full(2 * _FIRST, -1, np.int32)

    @property
    def capacity(self) -> int:
        """Blocks for which there is room."""
        return len(self.places)

    def grow(self) -> None:
        """Make room for more blocks."""
        capacity = int(self.capacity * _GROWTH)
        self.places = grown(self.places, capacity, 0)
        self.beside = grown(self.beside, capacity, -1)
        if capacity > _FULL * len(self.keys):
            self._hash(2 * len(self.keys))

    def keep(self, kept: Int) -> None:
        """Keep only the blocks (K,) of these numbers, which get the numbers 0 to K - 1."""
        self.places[: len(kept)] = self.places[kept]
        self.count = len(kept)
        self._hash(len(self.keys))
        self.beside[:] = -1
        link(self.keys, self.slots, self.places, self.beside, 0, self.count)

    def find(self, places: Int32) -> Int32:
        """Returns (N,) int32 numbers of the blocks at (N, 3) places, -1 where there is none."""
        found = np.empty(len(places), np.int32)
        _find_all(self.keys, self.slots, np.asarray(places, np.int32), found)
        return found

    def _hash(self, size: int) -> None:
        self.keys, self.slots = np.full(size, -1, np.int64), np.full(size, -1, np.int32)
        _insert_all(self.keys, self.slots, self.places, self.count)


def grown(array: np.ndarray, length: int, fill: float) -> np.ndarray:
    """Returns an array with more rows; the new ones hold ``fill``."""
    larger = np.full((length, *array.shape[1:]), fill, array.dtype)
    larger[: len(array)] = array
    return larger


@njit(cache=True, nogil=True, forceinline=True)
def key_of(x, y, z):
    """Returns the key of a block's place."""
    return ((np.int64(x) + _REACH) << 42) | ((np.int64(y) + _REACH) << 21) | (np.int64(z) + _REACH)


@njit(cache=True, nogil=True, forceinline=True)
def _home(key, size):
    """Returns where the search for a key begins in a table of ``size``, a power of two."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((mixed >> np.uint64(32)) & np.uint64(size - 1))


@njit(cache=True, nogil=True)
def find(keys, slots, key):
    """Returns the number of the block with a key, or -1."""
    at = _home(key, len(keys))
    while keys[at] != -1:
        if keys[at] == key:
            return slots[at]
        at = (at + 1) & (len(keys) - 1)
    return np.int32(-1)


@njit(cache=True, nogil=True)
def insert(keys, slots, key, number):
    """Gives a key that the table does not have a number."""
    at = _home(key, len(keys))
    while keys[at] != -1:
        at = (at + 1) & (len(keys) - 1)
    keys[at], slots[at] = key, number


@njit(cache=True, nogil=True)
def link(keys, slots, places, beside, first, last):
    """Makes the blocks ``first`` to ``last`` and those beside them neighbours."""
    for b in range(first, last):
        x, y, z = places[b, 0], places[b, 1], places[b, 2]
        for k in range(8):
            dx, dy, dz = k & 1, (k >> 1) & 1, k >> 2
            beside[b, k] = find(keys, slots, key_of(x + dx, y + dy, z + dz))
            before = find(keys, slots, key_of(x - dx, y - dy, z - dz))
            if before >= 0:
                beside[before, k] = b


@njit(cache=True, nogil=True)
def _insert_all(keys, slots, places, count):
    for b in range(count):
        insert(keys, slots, key_of(places[b, 0], places[b, 1], places[b, 2]), b)


@njit(cache=True, nogil=True)
def _find_all(keys, slots, places, found):
    for i in range(len(places)):
        found[i] = find(keys, slots, key_of(places[i, 0], places[i, 1], places[i, 2]))
