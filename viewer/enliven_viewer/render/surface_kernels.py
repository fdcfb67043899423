"""Hash-based kernels with linear running time, for :mod:`enliven_viewer.render.surface`."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.union_find import root_of

_EMPTY = np.int64(-1)
_SORTED_ABOVE = 64
"""If a vertex has more edges than this, they are sorted instead of compared pairwise."""


@njit(cache=True, nogil=True)
def _allocate_table(count):
    """Returns the key and value arrays of a hash table for ``count`` keys. The table's size is a power of two
    with spare slots.
    """
    size = 16
    while size < 1.4 * count:
        size *= 2
    return np.full(size, _EMPTY), np.empty(size, np.int32)


@njit(cache=True, nogil=True, inline="always")
def _find_slot(keys, key):
    """Returns the slot of a key in the table, or the empty slot for it."""
    mask = np.uint64(len(keys) - 1)
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    at = (mixed ^ (mixed >> np.uint64(32))) & mask
    while keys[np.int64(at)] != _EMPTY and keys[np.int64(at)] != key:
        at = (at + np.uint64(1)) & mask
    return np.int64(at)


@njit(cache=True, nogil=True)
def number_equal_rows(bits):
    """Returns (V,) group numbers for the rows of ``bits`` (V, C) int32. Equal rows get the same number."""
    count, columns = bits.shape
    size = 16
    while size < 1.4 * count:
        size *= 2
    mask = np.uint64(size - 1)
    first = np.full(size, -1, np.int32)
    out, group_count = np.empty(count, np.int32), 0
    for v in range(count):
        mixed = np.uint64(0)
        for c in range(columns):
            mixed = (mixed ^ np.uint64(np.uint32(bits[v, c]))) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        at = mixed & mask
        while True:
            other = first[np.int64(at)]
            if other < 0:
                first[np.int64(at)] = v
                out[v] = group_count
                group_count += 1
                break
            same = True
            for c in range(columns):
                same = same and bits[other, c] == bits[v, c]
            if same:
                out[v] = out[other]
                break
            at = (at + np.uint64(1)) & mask
    return out


@njit(cache=True, nogil=True)
def compute_corner_normals(vertices, faces):
    """Returns (F, 3) unit normals (zero for a face without area), and (F, 3) angles at the corners."""
    normals, angles = np.zeros((len(faces), 3)), np.empty((len(faces), 3))
    edges, lengths = np.empty((3, 3)), np.empty(3)
    for f in range(len(faces)):
        for k in range(3):
            total = 0.0
            for c in range(3):
                edges[k, c] = float(vertices[faces[f, (k + 1) % 3], c]) - float(vertices[faces[f, k], c])
                total += edges[k, c] * edges[k, c]
            lengths[k] = np.sqrt(total)
        n0 = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
        n1 = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
        n2 = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
        area = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        if area > 1e-14:
            normals[f, 0], normals[f, 1], normals[f, 2] = n0 / area, n1 / area, n2 / area
        for k in range(3):
            before = (k + 2) % 3
            dot = 0.0
            for c in range(3):
                dot -= edges[k, c] * edges[before, c]
            cosine = dot / max(lengths[k] * lengths[before], 1e-14)
            angles[f, k] = np.arccos(min(max(cosine, -1.0), 1.0))
    return normals, angles


@njit(cache=True, nogil=True)
def find_smoothing_groups(place, normals, cosine):
    """Returns (3 F,) the smoothing group of every corner of the faces (F, 3), and the number of groups.

    Uses union-find over the edges that are not sharp. Each face is joined with the previous face at the same
    edge.
    """
    count = len(place)
    most = np.int64(place.max()) + 1 if count else 1
    # Sort the half-edges by their lower vertex (counting sort). First count them, then sum the counts.
    starts = np.zeros(most + 1, np.int64)
    for k in range(3 * count):
        starts[_lower_vertex(place, k) + 1] += 1
    for v in range(most):
        starts[v + 1] += starts[v]
    # Put each half-edge into the range of its lower vertex.
    halves, filled = np.empty(3 * count, np.int64), starts[:-1].copy()
    for k in range(3 * count):
        low = _lower_vertex(place, k)
        halves[filled[low]] = k
        filled[low] += 1
    # Join the faces on both sides of each edge that is not sharp. At a vertex with few edges, compare them
    # pairwise.
    parents = np.arange(3 * count)
    for v in range(most):
        around = halves[starts[v] : starts[v + 1]]
        highs = np.empty(len(around), np.int64)
        for i in range(len(around)):
            highs[i] = _higher_vertex(place, around[i])
        if len(around) > _SORTED_ABOVE:
            order = np.argsort(highs, kind="mergesort")
            for i in range(1, len(order)):
                if highs[order[i]] == highs[order[i - 1]]:
                    _link(place, normals, cosine, parents, around[order[i - 1]], around[order[i]])
            continue
        for i in range(1, len(around)):
            for j in range(i - 1, -1, -1):
                if highs[j] == highs[i]:
                    _link(place, normals, cosine, parents, around[j], around[i])
                    break
    return _number_groups(parents)


@njit(cache=True, nogil=True, inline="always")
def _lower_vertex(place, half):
    """Returns the lower vertex number of the edge that begins at a corner."""
    return min(place[half // 3, half % 3], place[half // 3, (half % 3 + 1) % 3])


@njit(cache=True, nogil=True, inline="always")
def _higher_vertex(place, half):
    """Returns the higher vertex number of the edge that begins at a corner."""
    return max(place[half // 3, half % 3], place[half // 3, (half % 3 + 1) % 3])


@njit(cache=True, nogil=True)
def _link(place, normals, cosine, parents, one, other):
    """Joins the corners of two faces at both ends of their common edge, unless the edge is sharp."""
    f, g = one // 3, other // 3
    mild = 0.0
    for c in range(3):
        mild += normals[f, c] * normals[g, c]
    if mild < cosine:
        return
    a, b = one, 3 * f + (one % 3 + 1) % 3
    c, d = other, 3 * g + (other % 3 + 1) % 3
    if place[f, a % 3] != place[g, c % 3]:
        c, d = d, c
    parents[root_of(parents, a)] = root_of(parents, c)
    parents[root_of(parents, b)] = root_of(parents, d)


@njit(cache=True, nogil=True)
def _number_groups(parents):
    """Returns (K,) group numbers from 0 for a union-find forest (K,), and the number of groups."""
    numbers, group_count = np.full(len(parents), -1), 0
    for k in range(len(parents)):
        top = root_of(parents, k)
        if numbers[top] < 0:
            numbers[top] = group_count
            group_count += 1
        parents[k] = top
    for k in range(len(parents)):
        parents[k] = numbers[parents[k]]
    return parents, group_count


@njit(cache=True, nogil=True)
def number_drawn_vertices(group, faces, vertices):
    """Returns (3 F,) the drawn vertex of every corner, and (N,) the first corner of each drawn vertex.

    There is one drawn vertex per pair of a group and a number. ``faces`` (F, 3) contains the numbers, usually
    vertex indices. All are below ``vertices``.
    """
    keys, number = _allocate_table(len(group))
    corner, first, drawn_count = np.empty(len(group), np.int32), np.empty(len(group), np.int64), 0
    for k in range(len(group)):
        key = group[k] * vertices + faces[k // 3, k % 3]
        at = _find_slot(keys, key)
        if keys[at] == _EMPTY:
            keys[at], number[at] = key, drawn_count
            first[drawn_count] = k
            drawn_count += 1
        corner[k] = number[at]
    return corner, first[:drawn_count].copy()


@njit(cache=True, nogil=True)
def sum_normals(group, count, normals, angles):
    """Returns (G, 3) the sum of the face normals in each group, weighted by corner angle."""
    sums = np.zeros((count, 3))
    for k in range(len(group)):
        f = k // 3
        for c in range(3):
            sums[group[k], c] += normals[f, c] * angles[f, k % 3]
    return sums


@njit(cache=True, nogil=True)
def is_closed_mesh(faces, vertices):
    """Returns True if the mesh is closed, so that every edge exists once in each direction."""
    keys, _ = _allocate_table(3 * len(faces))
    for f in range(len(faces)):
        for k in range(3):
            key = np.int64(faces[f, k]) * vertices + faces[f, (k + 1) % 3]
            at = _find_slot(keys, key)
            if keys[at] != _EMPTY:
                return False
            keys[at] = key
    for f in range(len(faces)):
        for k in range(3):
            if keys[_find_slot(keys, np.int64(faces[f, (k + 1) % 3]) * vertices + faces[f, k])] == _EMPTY:
                return False
    return True


@njit(cache=True, nogil=True)
def first_indices(cells):
    """Returns (V,) indices: for each number in ``cells`` (V,), the index of its first occurrence."""
    keys, first = _allocate_table(len(cells))
    out = np.empty(len(cells), np.int32)
    for v in range(len(cells)):
        at = _find_slot(keys, cells[v])
        if keys[at] == _EMPTY:
            keys[at], first[at] = cells[v], v
        out[v] = first[at]
    return out
