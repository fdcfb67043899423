"""Compiled loops of :mod:`enliven.deformation.graph.surface`: clusters of vertices, links, nearest
neighbours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit
from enliven.union_find import join, number_sets


@njit(cache=True, nogil=True)
def grid_cells(vertices, size):
    """Returns (V,) int64 the number of the grid cell that contains each vertex. Cells have sides of ``size``
    metres, and the grid has at most 2^20 cells per side.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for v in range(vertices.shape[0]):
        for a in range(3):
            low[a], high[a] = min(low[a], vertices[v, a]), max(high[a], vertices[v, a])
    longest = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    per = 1.0 / max(size, longest / 1048000.0, 1e-300)
    out = np.empty(vertices.shape[0], np.int64)
    for v in range(vertices.shape[0]):
        x = np.int64((vertices[v, 0] - low[0]) * per)
        y = np.int64((vertices[v, 1] - low[1]) * per)
        z = np.int64((vertices[v, 2] - low[2]) * per)
        out[v] = (x << 40) | (y << 20) | z
    return out


@njit(cache=True, nogil=True)
def cluster_vertices(faces, cells):
    """Returns (V,) int32 the cluster of each vertex, and the number of clusters. A cluster is a connected
    part of the surface within a cell.
    """
    parent = np.arange(cells.shape[0]).astype(np.int32)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if cells[a] == cells[b]:
            join(parent, a, b)
        if cells[b] == cells[c]:
            join(parent, b, c)
        if cells[c] == cells[a]:
            join(parent, c, a)
    return number_sets(parent)


@njit(cache=True, nogil=True)
def cluster_means(vertices, label, count):
    """Returns (C, 3) the mean of each cluster's vertices, and (C,) float32 the distance from it to the
    farthest of them.
    """
    points, members = np.zeros((count, 3)), np.zeros(count)
    for v in range(vertices.shape[0]):
        c = label[v]
        members[c] += 1.0
        for a in range(3):
            points[c, a] += vertices[v, a]
    for c in range(count):
        for a in range(3):
            points[c, a] /= members[c]
    radii = np.zeros(count)
    for v in range(vertices.shape[0]):
        c = label[v]
        x, y, z = (
            vertices[v, 0] - points[c, 0],
            vertices[v, 1] - points[c, 1],
            vertices[v, 2] - points[c, 2],
        )
        radii[c] = max(radii[c], x * x + y * y + z * z)
    return points, np.sqrt(radii).astype(np.float32)


@njit(cache=True, nogil=True)
def group_by_label(label, count):
    """Groups items by their label. Returns (C + 1,) the index at which each label's items start, and (V,)
    int32 the items, ascending for each label.
    """
    starts = np.zeros(count + 1, np.int64)
    for v in range(label.shape[0]):
        starts[label[v] + 1] += 1
    for c in range(count):
        starts[c + 1] += starts[c]
    fill = starts[:-1].copy()
    order = np.empty(label.shape[0], np.int32)
    for v in range(label.shape[0]):
        order[fill[label[v]]] = v
        fill[label[v]] += 1
    return starts, order


@njit(cache=True, nogil=True)
def adjacent_clusters(vertices, faces, label, count):
    """Returns (E, 2) the pairs of clusters that share an edge, and (C, 3) the sum of the face normals at each
    cluster.
    """
    size = 1024
    while size < 16 * count:
        size *= 2
    table = np.full(size, -1, np.int64)
    pairs = np.empty((size // 2, 2), np.int32)
    pair_count = 0
    normals = np.zeros((count, 3))
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        corners = (label[i], label[j], label[k])
        if corners[0] == corners[1] and corners[1] == corners[2]:
            continue
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        ux, uy, uz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
        vx, vy, vz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for c in range(3):
            a, b = corners[c], corners[(c + 1) % 3]
            normals[a, 0] += nx
            normals[a, 1] += ny
            normals[a, 2] += nz
            if a == b:
                continue
            if a > b:
                a, b = b, a
            key = np.int64(a) * count + b
            slot = (key * np.int64(-7046029254386353131) >> np.int64(20)) & (size - 1)
            while table[slot] >= 0 and table[slot] != key:
                slot = (slot + 1) & (size - 1)
            if table[slot] < 0:
                table[slot] = key
                pairs[pair_count, 0], pairs[pair_count, 1] = a, b
                pair_count += 1
                if 2 * pair_count >= size:
                    size, table, pairs = _grown_table(size, pairs, pair_count, count)
    return pairs[:pair_count].copy(), normals


@njit(cache=True, nogil=True)
def _grown_table(size, pairs, found, count):
    """Returns a copy of the hash table of :func:`adjacent_clusters` with twice the number of slots."""
    size *= 2
    table = np.full(size, -1, np.int64)
    larger = np.empty((size // 2, 2), np.int32)
    for p in range(found):
        larger[p, 0], larger[p, 1] = pairs[p, 0], pairs[p, 1]
        key = np.int64(pairs[p, 0]) * count + pairs[p, 1]
        slot = (key * np.int64(-7046029254386353131) >> np.int64(20)) & (size - 1)
        while table[slot] >= 0:
            slot = (slot + 1) & (size - 1)
        table[slot] = key
    return size, table, larger


def sort_into_grid(points: Float, size: float) -> tuple[Int, Int, Any]:
    """Sorts points into cells with sides of ``size``. Returns the order of the points, (K + 1,) the start of
    each cell, and (K, 27) the cells around each cell.
    """
    low = points.min(0)
    size = max(size, float((points.max(0) - low).max()) / 1000, 1e-300)
    cells = ((points - low) / size).astype(np.int64) + 1
    shape = cells.max(0) + 2
    flat = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    order = np.argsort(flat, kind="stable")
    unique, first = np.unique(flat[order], return_index=True)
    steps = np.array(
        [(i * shape[1] + j) * shape[2] + k for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]
    )
    near = np.minimum(np.searchsorted(unique, unique[:, None] + steps), len(unique) - 1)
    near[unique[near] != unique[:, None] + steps] = -1
    return order, np.append(first, len(points)), near


_MAX_SHELL_LINKS = 3
"""Maximum number of links from a point to other shells. If touching shells had only one link, it would act as
a hinge."""


@njit(cache=True, nogil=True)
def link_near_points(points, normals, shell, order, starts, around, reach):
    """Returns (L, 2) links between points, i < j. A point has at most one link through a thin part, and three
    links to other shells.

    Args:
        order, starts, around: the result of :func:`sort_into_grid`, with cells at least as large as every
        reach.
        reach: (3,) metres, the maximum length of links through a part, across a seam, and between touching
            shells.
    """
    thin, seam, touch = reach[0], reach[1], reach[2]
    farthest = max(thin, seam, touch) ** 2
    out = np.empty(((1 + _MAX_SHELL_LINKS) * points.shape[0], 2), np.int64)
    best, nearest_points = np.empty(_MAX_SHELL_LINKS), np.empty(_MAX_SHELL_LINKS, np.int64)
    link_count = 0
    for cell in range(starts.shape[0] - 1):
        for place in range(starts[cell], starts[cell + 1]):
            i = order[place]
            # Search the neighbouring cells of the grid for near points.
            through, through_length = -1, thin
            near = np.int64(0)
            for m in range(27):
                near_cell = around[cell, m]
                if near_cell < 0:
                    continue
                for near_place in range(starts[near_cell], starts[near_cell + 1]):
                    j = order[near_place]
                    if j == i:
                        continue
                    x, y, z = (
                        points[j, 0] - points[i, 0],
                        points[j, 1] - points[i, 1],
                        points[j, 2] - points[i, 2],
                    )
                    length = x * x + y * y + z * z
                    if length > farthest:
                        continue
                    # Two points are on opposite sides of a thin part if each is behind the tangent plane of
                    # the other.
                    depth_i = -(x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2])
                    depth_j = x * normals[j, 0] + y * normals[j, 1] + z * normals[j, 2]
                    behind = depth_i > 0.0 and depth_j > 0.0
                    same = shell[i] == shell[j]
                    if same and not behind:
                        continue
                    length = np.sqrt(length)
                    facing = 0.0
                    for a in range(3):
                        facing += normals[i, a] * normals[j, a]
                    if behind and facing < 0.0 and (length, j) < (through_length, through):
                        through, through_length = j, length
                    if same:
                        continue
                    if length < touch or (length < seam and (behind or facing > 0.5)):
                        near = insert_sorted(best, nearest_points, near, length, j)
            # Write the link through the thin part, and the links to other shells.
            if through >= 0:
                out[link_count, 0], out[link_count, 1] = min(i, through), max(i, through)
                link_count += 1
            for m in range(near):
                out[link_count, 0], out[link_count, 1] = min(i, nearest_points[m]), max(i, nearest_points[m])
                link_count += 1
    return out[:link_count]


@njit(cache=True, nogil=True)
def insert_sorted(lengths, items, count, length, item):
    """Inserts a length and its item into the ascending lists ``lengths`` and ``items``. Returns the new
    count.

    Pass the length as float64 and the item as int64, because Numba compiles a version for every other type.
    """
    if count == lengths.shape[0]:
        if length >= lengths[count - 1]:
            return count
        count -= 1
    i = count
    while i > 0 and lengths[i - 1] > length:
        lengths[i], items[i] = lengths[i - 1], items[i - 1]
        i -= 1
    lengths[i], items[i] = length, item
    return count + 1
