"""Compiled shortest paths along a graph: between its nodes, around a node, and to all nodes within a
distance.
"""

from __future__ import annotations

import numpy as np

from enliven.heap import pop, push
from enliven.kernels import njit


@njit(cache=True, nogil=True)
def nearest_sources(offsets, neighbours, lengths, sources):
    """Runs Dijkstra's algorithm once for all sources together. Returns (C,) the distance in metres to the
    nearest source (infinite if no source reaches a point), and (C,) the number of this source (-1 if there is
    none).
    """
    count = offsets.shape[0] - 1
    metres, owner = np.full(count, np.inf), np.full(count, -1, np.int64)
    keys = np.empty(neighbours.shape[0] + sources.shape[0] + 1)
    items = np.empty(keys.shape[0], np.int64)
    size = np.int64(0)
    for s in sources:
        metres[s], owner[s] = 0.0, s
        size = push(keys, items, size, 0.0, s)
    while size > 0:
        length, v = keys[0], items[0]
        size = pop(keys, items, size)
        if length > metres[v]:
            continue
        for e in range(offsets[v], offsets[v + 1]):
            u = neighbours[e]
            if length + lengths[e] < metres[u]:
                metres[u], owner[u] = length + lengths[e], owner[v]
                size = push(keys, items, size, metres[u], np.int64(u))
    return metres, owner


@njit(cache=True, nogil=True)
def distances_from_sources(offsets, neighbours, lengths, sources, count, limit):
    """Runs Dijkstra's algorithm from each of the ``sources`` (N,) separately, up to ``limit`` metres.

    Returns:
        CSR over the first ``count`` points: offsets (count + 1,), (K,) the number of each source that reached
        the point, ascending, and (K,) the distances in metres.
    """
    metres, keys, items, reached = dijkstra_workspace(offsets, neighbours)
    total = metres.shape[0]
    point, distance, number = (
        np.empty(4 * total, np.int32),
        np.empty(4 * total),
        np.empty(4 * total, np.int32),
    )
    ends = np.zeros(count + 1, np.int64)
    end = 0
    for n in range(sources.shape[0]):
        settled = settle_within(offsets, neighbours, lengths, sources[n], limit, metres, keys, items, reached)
        if end + settled > point.shape[0]:
            needed = end + settled
            point, distance, number = (
                _grown_array(point, needed),
                _grown_array(distance, needed),
                _grown_array(number, needed),
            )
        for r in range(settled):
            u = reached[r]
            if u < count:
                point[end], distance[end], number[end] = u, metres[u], n
                ends[u + 1] += 1
                end += 1
            metres[u] = np.inf
    for c in range(count):
        ends[c + 1] += ends[c]
    fill = ends[:-1].copy()
    which, way = np.empty(end, np.int32), np.empty(end)
    for m in range(end):
        at = fill[point[m]]
        which[at], way[at] = number[m], distance[m]
        fill[point[m]] += 1
    return ends, which, way


@njit(cache=True, nogil=True)
def points_within(offsets, neighbours, lengths, limit):
    """Returns for each point the points within ``limit`` metres, nearest first.

    The result is CSR: offsets (C + 1,), points (K,), and distances (K,) in metres.
    """
    metres, keys, items, reached = dijkstra_workspace(offsets, neighbours)
    count = metres.shape[0]
    point, distance = np.empty(16 * count, np.int32), np.empty(16 * count)
    ends = np.zeros(count + 1, np.int64)
    for c in range(count):
        settled = settle_within(offsets, neighbours, lengths, c, limit, metres, keys, items, reached)
        end = ends[c] + settled
        if end > point.shape[0]:
            point, distance = _grown_array(point, end), _grown_array(distance, end)
        for r in range(settled):
            u = reached[r]
            point[ends[c] + r], distance[ends[c] + r] = u, metres[u]
            metres[u] = np.inf
        ends[c + 1] = end
    return ends, point[: ends[count]], distance[: ends[count]]


@njit(cache=True, nogil=True)
def dijkstra_workspace(offsets, neighbours):
    """Returns the buffers of :func:`settle_within`: distances (all infinite), the heap, and the reached
    points."""
    total = offsets.shape[0] - 1
    room = neighbours.shape[0] + 2
    return np.full(total, np.inf), np.empty(room), np.empty(room, np.int64), np.empty(total, np.int64)


@njit(cache=True, nogil=True)
def settle_within(offsets, neighbours, lengths, source, limit, metres, keys, items, reached):
    """Runs Dijkstra's algorithm from one source. Returns the number of points within ``limit`` metres. Their
    numbers are written into ``reached``, nearest first.
    """
    metres[source] = 0.0
    size = push(keys, items, np.int64(0), 0.0, source)
    settled = 0
    while size > 0:
        length, v = keys[0], items[0]
        size = pop(keys, items, size)
        if length > metres[v]:
            continue
        reached[settled] = v
        settled += 1
        for e in range(offsets[v], offsets[v + 1]):
            u = neighbours[e]
            further = length + lengths[e]
            if further < metres[u] and further <= limit:
                metres[u] = further
                size = push(keys, items, size, further, np.int64(u))
    return settled


@njit(cache=True, nogil=True)
def _grown_array(array, needed):
    """Returns a copy of the array with space for twice ``needed`` items."""
    out = np.empty(2 * needed, array.dtype)
    for i in range(array.shape[0]):
        out[i] = array[i]
    return out
