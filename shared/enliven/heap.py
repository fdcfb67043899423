"""A binary min-heap in two arrays (keys and items), for kernels."""

from __future__ import annotations

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def push(keys, items, size, key, item):
    """Adds an item to a heap with ``size`` entries. Returns the new size."""
    i = size
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] <= key:
            break
        keys[i], items[i] = keys[parent], items[parent]
        i = parent
    keys[i], items[i] = key, item
    return size + 1


@njit(cache=True, nogil=True)
def pop(keys, items, size):
    """Removes the entry with the smallest key, at index 0, from a heap with ``size`` entries. Returns the new
    size."""
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[i], items[i] = keys[child], items[child]
        i = child
    keys[i], items[i] = key, item
    return size
