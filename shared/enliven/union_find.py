"""Disjoint sets (union-find) as an array of parents: connected items get the same root."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def root_of(parent, i):
    """Returns the root of item i in ``parent`` (N,), with path halving."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def join(parent, i, j):
    """Merges the sets of i and j. The smaller index becomes the root."""
    a, b = root_of(parent, i), root_of(parent, j)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


@njit(cache=True, nogil=True)
def number_sets(parent):
    """Returns the set number of each item (N,) int32, and the number of sets. Sets are numbered in the order
    of their first items."""
    label = np.empty(parent.shape[0], np.int32)
    count = 0
    for i in range(parent.shape[0]):
        # The root is the first item of its set, so it has a number before any other item needs it.
        root = root_of(parent, i)
        if root == i:
            label[i] = count
            count += 1
        else:
            label[i] = label[root]
    return label, count
