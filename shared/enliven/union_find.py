"""Disjoint sets as an array of parents: what hangs together ends up under one root."""

from __future__ import annotations

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def root_of(parent, i):
    """The representative of i in (N,) ``parent``, with path halving."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def join(parent, i, j):
    """Unite the sets of i and j; the smaller index becomes the representative."""
    a, b = root_of(parent, i), root_of(parent, j)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b
