"""Connectivity of a graph: connected components, edges that join them, bridges and cut vertices."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.kernels import njit
from enliven.union_find import join, number_sets


def label_components(count: int, edges: Int32 | Int) -> Int:
    """Returns the number (N,) of the connected component of each node, in the order of the nodes."""
    return np.asarray(_number_components(count, np.ascontiguousarray(edges, np.int64)), np.int64)


@njit(cache=True, nogil=True)
def _number_components(count, edges):
    """Numbers the components of ``count`` nodes that (E, 2) ``edges`` connect."""
    parent = np.arange(count).astype(np.int32)
    for e in range(edges.shape[0]):
        join(parent, edges[e, 0], edges[e, 1])
    return number_sets(parent)[0]


def find_joining_edges(count: int, edges: Int32 | Int, distances: Float) -> Int32:
    """Returns the edges (C - 1, 2) that join C components into one, with the smallest sum of distances.

    KinÊtre, "Mesh Connectivity and Regularization": the minimum spanning tree over the components. The
    distance of two components is the distance of their nearest two nodes. Borůvka's algorithm adds the
    shortest outgoing edge of every component, until one component is left.

    Args:
        distances: (N, N) metres between nodes, symmetric, and finite off the diagonal.
    """
    added: list[tuple[int, int]] = []
    label = label_components(count, edges)
    while label.max() > 0:
        shortest = _shortest_ways_out(distances, label)
        for i, j in shortest:
            if label[i] != label[j]:
                added.append((min(i, j), max(i, j)))
                label[label == label[j]] = label[i]
        label = np.unique(label, return_inverse=True)[1].reshape(-1)
    return np.array(added, np.int32).reshape(-1, 2)


@njit(cache=True, nogil=True)
def _shortest_ways_out(distances, label):
    """Returns (C, 2) for each component its shortest outgoing edge: a node inside, and a node outside."""
    count = label.max() + 1
    best = np.full(count, np.inf)
    out = np.zeros((count, 2), np.int64)
    for i in range(label.shape[0]):
        for j in range(label.shape[0]):
            if label[i] != label[j] and distances[i, j] < best[label[i]]:
                best[label[i]] = distances[i, j]
                out[label[i], 0], out[label[i], 1] = i, j
    return out


def find_weak_edges(count: int, edges: Int32) -> tuple[Bool, Bool, Bool]:
    """Returns the bridges and cut vertices of a connected graph, by Tarjan's low-link algorithm.

    Returns:
        bridges: (E,) true for an edge that splits the graph when removed.
        cut_vertices: (N,) true for a node that splits the graph when removed.
        hanging: (E,) true for bridges, and for edges from a cut vertex to any of its parts except the
            largest.
    """
    offsets, neighbours, edge_of = _neighbours_with_edges(count, edges)
    bridges, cuts = _bridges_and_cut_vertices(offsets, neighbours, edge_of, len(edges))
    hanging = bridges.copy()
    for cut_nodes in np.flatnonzero(cuts):
        touching = (edges == cut_nodes).any(1)
        label = label_components(count, edges[~touching])
        sizes = np.bincount(label)
        sizes[label[cut_nodes]] = 0
        ends = np.where(edges[:, 0] == cut_nodes, edges[:, 1], edges[:, 0])
        hanging |= touching & (label[ends] != sizes.argmax())
    return bridges, cuts, hanging


def _neighbours_with_edges(count: int, edges: Int32) -> tuple[Int, Int, Int]:
    """Returns the neighbours of each node as CSR: offsets (N + 1,), neighbours (2 E,), and (2 E,) the number
    of the edge to each neighbour."""
    ends = np.concatenate([edges, edges[:, ::-1]]).astype(np.int64)
    number = np.tile(np.arange(len(edges)), 2)
    order = np.argsort(ends[:, 0], kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=count))])
    return offsets, ends[order, 1], number[order]


@njit(cache=True, nogil=True)
def _bridges_and_cut_vertices(offsets, neighbours, edge_of, edge_count):
    """Returns masks of the bridges (E,) and the cut vertices (N,). This is Tarjan's algorithm: depth-first
    search, here without recursion."""
    count = offsets.shape[0] - 1
    bridges, cuts = np.zeros(edge_count, np.bool_), np.zeros(count, np.bool_)
    order, low = np.full(count, -1, np.int64), np.zeros(count, np.int64)
    came_by, fill = np.full(count, -1, np.int64), offsets[:-1].copy()
    stack = np.empty(count, np.int64)
    clock = 0
    for root in range(count):
        if order[root] >= 0:
            continue
        stack[0], depth, children = root, 1, 0
        order[root] = low[root] = clock
        clock += 1
        while depth > 0:
            v = stack[depth - 1]
            if fill[v] < offsets[v + 1]:
                u, e = neighbours[fill[v]], edge_of[fill[v]]
                fill[v] += 1
                if e == came_by[v]:
                    continue
                if order[u] >= 0:
                    low[v] = min(low[v], order[u])
                    continue
                came_by[u] = e
                order[u] = low[u] = clock
                clock += 1
                stack[depth] = u
                depth += 1
                continue
            depth -= 1
            if depth > 0:
                parent = stack[depth - 1]
                low[parent] = min(low[parent], low[v])
                if low[v] > order[parent]:
                    bridges[came_by[v]] = True
                if parent == root:
                    children += 1
                elif low[v] >= order[parent]:
                    cuts[parent] = True
        cuts[root] = children > 1
    return bridges, cuts
