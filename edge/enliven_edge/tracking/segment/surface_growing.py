"""Region growing: assigns pixels where people touch by connected surface, instead of by the nearest fit.

An arm that the fit lost is far from its own model and may be near another person's, especially if the two
hold hands. But its surface is still connected to the right shoulder.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int16
from enliven.kernels import njit
from enliven.union_find import join, root_of

_MIN_CONTACT_PIXELS = 3
"""Minimum number of contact pixels for a piece of surface to be reassigned to a person. Fewer may be
noise.
"""
_MAX_LIMB_RATIO = 0.4
"""Maximum size of a reassigned piece relative to the person's largest piece: a limb, not another body."""
_CLEAR_DISTANCE_M = 0.1
"""Distance in metres from a person's surface within which a pixel clearly belongs to the person."""


def grow_surfaces(owner: Int16, distance: Float, z: Float) -> None:
    """Reassigns the ambiguous pixels where two people touch, in place.

    Each pixel goes to the person with the nearest clearly assigned pixels along the surface.

    Args:
        owner: (h, w) the index of the person who owns each pixel, or -1.
        distance: (h, w) metres from the owner's predicted surface.
        z: (h, w) metres along the optical axis.
    """
    if _people_touch(owner, z, distance, _CLEAR_DISTANCE_M):
        _grow_regions(owner, distance, z)


@njit(cache=True, nogil=True)
def _rows_touch(owner, v):
    """Returns True if neighbouring pixels within a row, or in a row and the one above, belong to two people.

    Depth is not compared. The loop has no branch, so that the compiler can vectorise it. An early exit would
    rarely help, because the result is mostly False.
    """
    row, above = owner[v], owner[max(0, v - 1)]
    abuts = False
    for u in range(len(row)):
        abuts |= (row[u] >= 0) & (above[u] >= 0) & (row[u] != above[u])
    for u in range(1, len(row)):
        abuts |= (row[u] >= 0) & (row[u - 1] >= 0) & (row[u] != row[u - 1])
    return abuts


@njit(cache=True, nogil=True)
def _people_touch(owner, z, distance, least):
    """Returns True if two people's pixels are neighbours on one surface.

    One of them must have a (h, w) ``distance`` above ``least``.
    """
    height, width = owner.shape
    for v in range(height):
        if not _rows_touch(owner, v):
            continue
        for u in range(width):
            for q, p in ((v, u - 1), (v - 1, u)):
                if q < 0 or p < 0 or owner[q, p] == owner[v, u] or min(owner[q, p], owner[v, u]) < 0:
                    continue
                if max(distance[v, u], distance[q, p]) > least and _is_same_surface(z[v, u], z[q, p]):
                    return True
    return False


@njit(cache=True, nogil=True)
def _grow_regions(owner, distance, z):
    """Grows regions breadth first from all clearly assigned pixels at once.

    Unreached pixels keep their owner.
    """
    height, width = owner.shape
    queue, reached = np.empty(height * width, np.int64), np.zeros((height, width), np.bool_)
    last = 0
    for v in range(height):
        for u in range(width):
            if owner[v, u] >= 0 and distance[v, u] <= _CLEAR_DISTANCE_M:
                queue[last], reached[v, u], last = v * width + u, True, last + 1
    first = 0
    while first < last:
        v, u = queue[first] // width, queue[first] % width
        first += 1
        for q, p in ((v, u - 1), (v, u + 1), (v - 1, u), (v + 1, u)):
            inside = 0 <= q < height and 0 <= p < width
            if inside and owner[q, p] >= 0 and not reached[q, p] and _is_same_surface(z[v, u], z[q, p]):
                owner[q, p], reached[q, p] = owner[v, u], True
                queue[last], last = q * width + p, last + 1


def reassign_detached_pieces(owner: Int16, z: Float, counts: Int) -> Int:
    """Reassigns pieces that are connected to another person but not to their owner, in place.

    After two arms have touched, one person's fit may follow the other's arm. This step returns the arm as
    soon as the two people have separated.

    Args:
        owner: (h, w) the index of the person who owns each pixel, or -1.
        z: (h, w) metres along the optical axis.
        counts: (K,) each person's number of pixels.

    Returns:
        (K,) each person's number of pixels afterwards.
    """
    if not _people_touch(owner, z, z, 0.0):
        # If two people touch nowhere, nothing changes. Depths are above 0, so the limit 0 applies everywhere.
        return counts
    number, owner_of, size = _label_pieces(_union_pixels(owner, z), owner)
    largest = np.array([_find_largest_piece(owner_of, size, k) for k in range(len(counts))])
    contacts = _count_contacts(owner, z, number, owner_of, largest)
    other = contacts.argmax(1)
    loose = (np.arange(len(size)) != largest[owner_of]) & (contacts.max(1) >= _MIN_CONTACT_PIXELS)
    loose &= size < _MAX_LIMB_RATIO * np.where(largest[other] < 0, 0, size[largest[other]])
    if loose.any():
        inside = number >= 0
        owner[inside] = np.where(loose, other, owner_of)[number[inside]]
        counts = np.bincount(owner[inside], minlength=len(counts))
    return counts


def _find_largest_piece(owner_of: Int, size: Int, person: int) -> int:
    """Returns the number of a person's largest piece, or -1 without any piece."""
    pieces = np.flatnonzero(owner_of == person)
    return int(pieces[size[pieces].argmax()]) if len(pieces) else -1


@njit(cache=True, nogil=True)
def _union_pixels(owner, z):
    """Returns (h * w,) union-find parents of each person's connected pixels, or -1 without an owner."""
    height, width = z.shape
    parent = np.full(height * width, -1, np.int64)
    for v in range(height):
        for u in range(width):
            if owner[v, u] < 0:
                continue
            here = v * width + u
            parent[here] = here
            for back, q, p in ((1, v, u - 1), (width, v - 1, u)):
                if q >= 0 and p >= 0 and owner[q, p] == owner[v, u] and _is_same_surface(z[v, u], z[q, p]):
                    join(parent, here, here - back)
    return parent


@njit(cache=True, nogil=True)
def _is_same_surface(one, other):
    """Returns True if the depths of two neighbours are on one surface."""
    return abs(one - other) < 0.035 + 0.012 * one * other


@njit(cache=True, nogil=True)
def _label_pieces(parent, owner):
    """Returns (h, w) the piece of each pixel, or -1, and two arrays with one entry per piece.

    The arrays are the (P,) owner and the (P,) number of pixels of each piece.
    """
    height, width = owner.shape
    number = np.full((height, width), -1, np.int64)
    owner_of, size = np.empty(len(parent), np.int64), np.zeros(len(parent), np.int64)
    pieces = 0
    for here in range(len(parent)):
        if parent[here] < 0:
            continue
        v, u, root = here // width, here % width, root_of(parent, here)
        # The root is the smallest index of its piece, so it is numbered before all other pixels of the piece.
        if root == here:
            number[v, u], owner_of[pieces], pieces = pieces, owner[v, u], pieces + 1
        number[v, u] = number[root // width, root % width]
        size[number[v, u]] += 1
    return number, owner_of[:pieces].copy(), size[:pieces].copy()


@njit(cache=True, nogil=True)
def _count_contacts(owner, z, number, owner_of, largest):
    """Returns (P, K) the number of contact pixels between each piece and the largest piece of each other
    person.
    """
    height, width = z.shape
    out = np.zeros((len(owner_of), len(largest)), np.int64)
    for v in range(height):
        for u in range(width):
            if number[v, u] < 0:
                continue
            for q, p in ((v, u - 1), (v - 1, u)):
                if q < 0 or p < 0 or number[q, p] < 0 or owner[q, p] == owner[v, u]:
                    continue
                if _is_same_surface(z[v, u], z[q, p]):
                    a, b = number[v, u], number[q, p]
                    out[a, owner_of[b]] += b == largest[owner_of[b]]
                    out[b, owner_of[a]] += a == largest[owner_of[a]]
    return out
