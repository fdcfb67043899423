"""Disjoint sets (union-find) as an array of parents: connected items get the same root."""

from __future__ import annotations

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def root_of(parent, i):
    """Returns the root of i in (N,) ``parent``, with path halving."""
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
