"""What hangs together with somebody is theirs: where people meet, the surface decides, not the nearest fit.

An arm that has been lost is far from its own fit and may be near to somebody else's, above all when they hold
hands. Its surface still begins at its own shoulder.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit
from enliven.union_find import join, root_of

_HOLDS, _A_PART = 3, 0.4
"""Pixels by which a piece must touch somebody to hang together with them, and its size at most, of theirs."""
_PLAIN = 0.1
"""Metres from somebody's surface within which a pixel is plainly theirs."""


def grown(owner: Int, distance: Float, z: Float) -> None:
    """Shares out anew, in place, what lies on nobody's surface where two people meet.

    It goes to whose plain pixels are nearest along the surface, pixel by pixel.

    Args:
        owner: (h, w) the index of the person whose pixel it is, or -1.
        distance: (h, w) metres from their predicted surface.
        z: (h, w) metres along the optical axis.
    """
    if _contested(owner, distance, z):
        _grow(owner, distance, z)


@njit(cache=True, nogil=True)
def _contested(owner, distance, z):  # type: ignore[no-untyped-def]
    """Whether a pixel that is not plainly somebody's touches another's."""
    height, width = owner.shape
    for v in range(height):
        if not _abut(owner, v):
            continue
        for u in range(width):
            if owner[v, u] < 0:
                continue
            for q, p in ((v, u - 1), (v - 1, u)):
                if q < 0 or p < 0 or owner[q, p] < 0 or owner[q, p] == owner[v, u]:
                    continue
                if max(distance[v, u], distance[q, p]) > _PLAIN and _near(z[v, u], z[q, p]):
                    return True
    return False


@njit(cache=True, nogil=True)
def _abut(owner, v):  # type: ignore[no-untyped-def]
    """Whether two people's pixels lie side by side in a row, or in it and the one above; in any depth.

    Without a branch, so that many pixels are looked at at once: mostly nobody's do.
    """
    row, above = owner[v], owner[max(0, v - 1)]
    found = False
    for u in range(len(row)):
        found |= (row[u] >= 0) & (above[u] >= 0) & (row[u] != above[u])
    for u in range(1, len(row)):
        found |= (row[u] >= 0) & (row[u - 1] >= 0) & (row[u] != row[u - 1])
    return found


@njit(cache=True, nogil=True)
def _meet(owner, z):  # type: ignore[no-untyped-def]
    """Whether two people's pixels lie side by side on one surface."""
    height, width = owner.shape
    for v in range(height):
        if not _abut(owner, v):
            continue
        for u in range(width):
            for q, p in ((v, u - 1), (v - 1, u)):
                if q < 0 or p < 0 or owner[q, p] == owner[v, u] or min(owner[q, p], owner[v, u]) < 0:
                    continue
                if _near(z[v, u], z[q, p]):
                    return True
    return False


@njit(cache=True, nogil=True)
def _grow(owner, distance, z):  # type: ignore[no-untyped-def]
    """Breadth first from all plain pixels at once; what none of them reaches stays whose it was."""
    height, width = owner.shape
    queue, reached = np.empty(height * width, np.int64), np.zeros((height, width), np.bool_)
    last = 0
    for v in range(height):
        for u in range(width):
            if owner[v, u] >= 0 and distance[v, u] <= _PLAIN:
                queue[last], reached[v, u], last = v * width + u, True, last + 1
    first = 0
    while first < last:
        v, u = queue[first] // width, queue[first] % width
        first += 1
        for q, p in ((v, u - 1), (v, u + 1), (v - 1, u), (v + 1, u)):
            inside = 0 <= q < height and 0 <= p < width
            if inside and owner[q, p] >= 0 and not reached[q, p] and _near(z[v, u], z[q, p]):
                owner[q, p], reached[q, p] = owner[v, u], True
                queue[last], last = q * width + p, last + 1


def given_back(owner: Int, z: Float, counts: Int) -> Int:
    """Gives what hangs together with another person, and not with its owner, to that other, in place.

    An arm that touched somebody's may be followed by their fit instead of its own: here it is let go as soon
    as the two are apart.

    Args:
        owner: (h, w) the index of the person whose pixel it is, or -1.
        z: (h, w) metres along the optical axis.
        counts: (K,) each person's pixels.

    Returns:
        (K,) each person's pixels now.
    """
    if not _meet(owner, z):
        return counts
    number, whose, size = _pieces(_joined(owner, z), owner)
    largest = np.array([_largest(whose, size, k) for k in range(len(counts))])
    contacts = _contacts(owner, z, number, whose, largest)
    other = contacts.argmax(1)
    loose = (np.arange(len(size)) != largest[whose]) & (contacts.max(1) >= _HOLDS)
    loose &= size < _A_PART * np.where(largest[other] < 0, 0, size[largest[other]])
    if loose.any():
        inside = number >= 0
        owner[inside] = np.where(loose, other, whose)[number[inside]]
        counts = np.bincount(owner[inside], minlength=len(counts))
    return counts


def _largest(whose: Int, size: Int, person: int) -> int:
    """The largest piece of a person; -1: there is none."""
    theirs = np.flatnonzero(whose == person)
    return int(theirs[size[theirs].argmax()]) if len(theirs) else -1


@njit(cache=True, nogil=True)
def _joined(owner, z):  # type: ignore[no-untyped-def]
    """(h w,) parents of each person's pixels that hang together, -1 for nobody's."""
    height, width = z.shape
    parent = np.full(height * width, -1, np.int64)
    for v in range(height):
        for u in range(width):
            if owner[v, u] < 0:
                continue
            here = v * width + u
            parent[here] = here
            for back, q, p in ((1, v, u - 1), (width, v - 1, u)):
                if q >= 0 and p >= 0 and owner[q, p] == owner[v, u] and _near(z[v, u], z[q, p]):
                    join(parent, here, here - back)
    return parent


@njit(cache=True, nogil=True)
def _near(one, other):  # type: ignore[no-untyped-def]
    """Whether the depths of two neighbours are on one surface."""
    return abs(one - other) < 0.035 + 0.012 * one * other


@njit(cache=True, nogil=True)
def _pieces(parent, owner):  # type: ignore[no-untyped-def]
    """(h, w) the number of each pixel's piece, -1 for nobody's; whose each piece is, and its pixels."""
    height, width = owner.shape
    number = np.full((height, width), -1, np.int64)
    whose, size = np.empty(len(parent), np.int64), np.zeros(len(parent), np.int64)
    pieces = 0
    for here in range(len(parent)):
        if parent[here] < 0:
            continue
        v, u, root = here // width, here % width, root_of(parent, here)
        # A root is the smallest index of its piece, so it was numbered before all others.
        if root == here:
            number[v, u], whose[pieces], pieces = pieces, owner[v, u], pieces + 1
        number[v, u] = number[root // width, root % width]
        size[number[v, u]] += 1
    return number, whose[:pieces].copy(), size[:pieces].copy()


@njit(cache=True, nogil=True)
def _contacts(owner, z, number, whose, largest):  # type: ignore[no-untyped-def]
    """(P, K) at how many pixels each piece touches the largest piece of each other person."""
    height, width = z.shape
    out = np.zeros((len(whose), len(largest)), np.int64)
    for v in range(height):
        for u in range(width):
            if number[v, u] < 0:
                continue
            for q, p in ((v, u - 1), (v - 1, u)):
                if q < 0 or p < 0 or number[q, p] < 0 or owner[q, p] == owner[v, u]:
                    continue
                if _near(z[v, u], z[q, p]):
                    a, b = number[v, u], number[q, p]
                    out[a, whose[b]] += b == largest[whose[b]]
                    out[b, whose[a]] += a == largest[whose[a]]
    return out
