"""Skin weights: the nodes that a point follows, and their weights (KinÊtre, below eq. 2).

In KinÊtre, a point follows its four nearest nodes with the linear fall-off 1 - d / d_max. d is the Euclidean
distance, d_max is the distance to the fifth node, and the weights sum to one. So a vertex of one leg may
follow the other leg. If five nodes are about equally far away, the weights shift between them within
millimetres, and the surface creases. This module differs in three steps:

1. d(v, j) = e + 2 max(0, g - 1.5 e - s / 2). e is the Euclidean distance, g is the geodesic distance along
the surface, and s is the node spacing. d equals e until the path along the surface is a detour. From there, d
grows with the detour. With Euclidean distances, both faces of a thin board follow the same nodes. The paths
of g also go through thin parts (:mod:`enliven.deformation.graph.surface`). d is continuous along the surface,
and so are the weights, even if the set of four nodes changes, because a node enters the set with weight zero.
   d_max is at most two spacings, so that the tip of an arm does not follow the other arms.
2. Only *carriers* are followed: nodes that are not too near to each other along the surface. Eq. 6 clusters
   nodes where the surface bends. The other nodes act on the carriers through the graph.
3. A vertex takes the mean of these weights over the surface around it. The four largest weights are kept. The
  fifth is subtracted from them, so that they stay continuous, and they are scaled to sum to one.

(R. W. Sumner et al., "Embedded deformation for shape manipulation", 2007, eq. 4, squares the fall-off.)
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.graph.surface import SurfaceNet, points_around, vertices_of_points
from enliven.deformation.graph.surface_kernels import insert_sorted
from enliven.document import SkinWeights
from enliven.kernels import njit

MAX_DETOUR_RATIO = 1.5
"""Maximum ratio of the path along the surface to the straight distance. A longer path is a detour. Below it,
the curvature of the surface alone can explain the length."""
DETOUR_TOLERANCE_SPACINGS = 0.5
"""Additional tolerance for detours, in node spacings, because paths over the net are coarse."""
_MIN_NODE_DISTANCE_SPACINGS = 0.6
"""Minimum distance, in node spacings, between two carriers (nodes that vertices follow)."""
_MAX_DISTANCE_IN_SPACINGS = 2.0
"""Distance, in node spacings, beyond which a node has no weight, unless it is one of the nearest."""
_AVERAGING_RADIUS_SPACINGS = 0.6
"""Radius, in node spacings, of the part of the surface over which the weights of a point are averaged."""
_MAX_POINT_DISTANCE_CELLS = 1.8
"""Maximum distance, in net cells, from a vertex to the points of the net that its weights are averaged over.
It is more than a cell's diagonal, so that the vertex's own point is included."""
_MAX_PATH_LENGTH_CELLS = 2.7
"""Maximum distance of these points along the surface, in net cells: 1.5 times as far, because paths bend."""
_MAX_SOURCE_POINTS = 64
"""Maximum number of points of the net that a vertex's weights are averaged over, nearest to its own first."""
_MAX_NODES_PER_POINT = 12
"""Maximum number of nodes that a point of the net follows."""
_MAX_CANDIDATE_NODES = 64
"""Maximum number of nodes that are considered for the vertices of one point of the net."""


def choose_followed_nodes(positions: Float, distances: Float, spacing: float, min_count: int = 5) -> Int:
    """Returns the carriers (M,), ascending: the nodes that vertices follow. No carrier is near to an earlier
    one.

    If there would be fewer than ``min_count`` carriers, returns all nodes.

    Args:
        positions: (N, 3) metres, the nodes at rest.
        distances: (N, N) metres, the distances along the surface.
        spacing: metres between nodes.
    """
    straight = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    near = (straight < _MIN_NODE_DISTANCE_SPACINGS * spacing) & (
        distances < 1.5 * _MIN_NODE_DISTANCE_SPACINGS * spacing
    )
    chosen = np.zeros(len(positions), bool)
    for j in range(len(positions)):
        chosen[j] = not (near[j] & chosen).any()
    return np.flatnonzero(chosen) if chosen.sum() >= min_count else np.arange(len(positions))


def blending_weights(
    net: SurfaceNet, near: tuple[Int, Int32, Float], positions: Float, spacing: float, k: int = 4
) -> SkinWeights:
    """Returns four nodes and weights for each vertex of the net's mesh, the largest first.

    Args:
        net: the net of the mesh.
        near: the carriers near each point of the net, and their distances along the surface, from
            :func:`enliven.deformation.graph.surface.node_distances`.
        positions: (N, 3) metres, the nodes at rest.
        spacing: metres between nodes, the s of the module's docstring.
        k: nodes per vertex, at most 4.
    """
    nodes, shares = _compute_point_weights(net.points, *near, positions, spacing, k)
    around = points_around(net, max(_AVERAGING_RADIUS_SPACINGS * spacing, _MAX_PATH_LENGTH_CELLS * net.cell))
    nodes, shares = _mean_weights(
        nodes, shares, *around, _AVERAGING_RADIUS_SPACINGS * spacing, len(positions)
    )
    cells = np.array([_MAX_POINT_DISTANCE_CELLS, _MAX_PATH_LENGTH_CELLS]) * net.cell
    indices, weights = _compute_vertex_weights(
        net.mesh.vertices, *vertices_of_points(net), net.points, nodes, shares, *around, cells, k
    )
    return SkinWeights(indices, weights)


@njit(cache=True, nogil=True)
def _compute_point_weights(points, offsets, nodes, ways, positions, spacing, k):
    """Returns (C, k) int32 nodes (-1 for none) and (C, k) weights of the net's points: steps 1 and 2."""
    chosen = np.full((points.shape[0], k), -1, np.int32)
    shares = np.zeros((points.shape[0], k))
    near, near_nodes = np.empty(k + 1), np.empty(k + 1, np.int64)
    for c in range(points.shape[0]):
        near_count = np.int64(0)
        for m in range(offsets[c], offsets[c + 1]):
            j = nodes[m]
            x, y, z = (
                points[c, 0] - positions[j, 0],
                points[c, 1] - positions[j, 1],
                points[c, 2] - positions[j, 2],
            )
            straight = np.sqrt(x * x + y * y + z * z)
            length = straight + 2.0 * max(
                0.0, ways[m] - MAX_DETOUR_RATIO * straight - DETOUR_TOLERANCE_SPACINGS * spacing
            )
            near_count = insert_sorted(near, near_nodes, near_count, length, np.int64(j))
        # With four nodes or fewer, the fifth distance for the radius is missing. Use a slightly larger radius
        # than the distance of the farthest node, so that this node keeps a little weight.
        most = near[k] if near_count > k else 1.25 * near[near_count - 1] + 1e-12
        most = min(most, max(_MAX_DISTANCE_IN_SPACINGS * spacing, 1.5 * near[0]))
        total = 0.0
        for m in range(min(near_count, k)):
            total += max(0.0, 1.0 - near[m] / most)
        for m in range(min(near_count, k)):
            chosen[c, m] = near_nodes[m]
            shares[c, m] = max(0.0, 1.0 - near[m] / most) / total if total > 0.0 else 1.0 / min(near_count, k)
    return chosen, shares


@njit(cache=True, nogil=True)
def _mean_weights(nodes, shares, starts, around, metres, radius, count):
    """Returns (C, 12) nodes (-1 for none), and (C, 12) their mean weights over the points around each point:
    step 3.
    """
    chosen = np.full((starts.shape[0] - 1, _MAX_NODES_PER_POINT), -1, np.int32)
    means = np.zeros(chosen.shape, np.float32)
    total = np.zeros(count)
    touched = np.empty(count, np.int64)
    largest, largest_nodes = np.empty(_MAX_NODES_PER_POINT), np.empty(_MAX_NODES_PER_POINT, np.int64)
    for c in range(chosen.shape[0]):
        some, share_sum = 0, 0.0
        for b in range(starts[c], starts[c + 1]):
            if metres[b] >= radius:
                break
            share = (1.0 - (metres[b] / radius) ** 2) ** 2
            share_sum += share
            for m in range(nodes.shape[1]):
                j = nodes[around[b], m]
                if j < 0:
                    break
                if total[j] == 0.0:
                    touched[some] = j
                    some += 1
                total[j] += share * shares[around[b], m] + 1e-300
        kept_count = np.int64(0)
        for t in range(some):
            kept_count = insert_sorted(largest, largest_nodes, kept_count, -total[touched[t]], touched[t])
        for m in range(kept_count):
            chosen[c, m], means[c, m] = largest_nodes[m], -largest[m] / share_sum
        for t in range(some):
            total[touched[t]] = 0.0
    return chosen, means


@njit(cache=True, nogil=True, fastmath=True)
def _compute_vertex_weights(  # noqa: PLR0915, a kernel
    vertices, starts, order, points, nodes, shares, offsets, around, metres, cells, k
):
    """Returns (V, 4) uint16 nodes and (V, 4) float32 weights of the vertices, averaged over the points of the
    net around each vertex.
    """
    indices = np.zeros((vertices.shape[0], 4), np.uint16)
    weights = np.zeros((vertices.shape[0], 4), np.float32)
    per = 1.0 / (cells[0] * cells[0])
    place = np.full(65536, -1, np.int32)
    union = np.empty(_MAX_CANDIDATE_NODES, np.int32)
    table, mean = (
        np.empty((_MAX_SOURCE_POINTS, _MAX_CANDIDATE_NODES), np.float32),
        np.empty(_MAX_CANDIDATE_NODES, np.float32),
    )
    largest, largest_columns = np.empty(k + 1), np.empty(k + 1, np.int64)
    for c in range(points.shape[0]):
        if starts[c] == starts[c + 1]:
            continue
        # Collect the nodes of all points around this point. They become the columns of a table of weights.
        first, some = offsets[c], 0
        last = first
        while last < min(offsets[c + 1], first + _MAX_SOURCE_POINTS) and metres[last] <= cells[1]:
            last += 1
        for b in range(first, last):
            table[b - first, :] = 0.0
            for m in range(_MAX_NODES_PER_POINT):
                j = nodes[around[b], m]
                if j < 0:
                    break
                if place[j] < 0 and some < _MAX_CANDIDATE_NODES:
                    place[j], union[some] = some, j
                    some += 1
                if place[j] >= 0:
                    table[b - first, place[j]] = shares[around[b], m]
        for m in range(some):
            place[union[m]] = -1
        # Drop nodes that cannot have one of the largest weights of any vertex.
        some = _drop_small_columns(table, last - first, union, some, largest, largest_columns)
        # Average the table for each vertex of this point. Keep the four largest weights, each reduced by the
        # fifth.
        for i in range(starts[c], starts[c + 1]):
            v = order[i]
            mean[:some] = 0.0
            for b in range(first, last):
                p = around[b]
                x, y, z = (
                    vertices[v, 0] - points[p, 0],
                    vertices[v, 1] - points[p, 1],
                    vertices[v, 2] - points[p, 2],
                )
                inside = np.float32(1.0 - (x * x + y * y + z * z) * per)
                if inside > 0.0:
                    share, row = inside * inside, table[b - first]
                    for m in range(some):
                        mean[m] += share * row[m]
            kept_count = np.int64(0)
            for m in range(some):
                if mean[m] > 0.0 and (kept_count <= k or -mean[m] < largest[k]):
                    kept_count = insert_sorted(largest, largest_columns, kept_count, np.float64(-mean[m]), m)
            least = -largest[k] if kept_count > k else 0.0
            total = 0.0
            for m in range(min(kept_count, k)):
                total += -largest[m] - least
            for m in range(min(kept_count, k)):
                indices[v, m] = union[largest_columns[m]]
                weights[v, m] = (-largest[m] - least) / total if total > 0.0 else 1.0 / min(kept_count, k)
    return indices, weights


@njit(cache=True, nogil=True)
def _drop_small_columns(table, rows, union, some, largest, who):
    """Removes columns of ``table`` that cannot be among the k largest in any mean of the rows. Returns the
    number of remaining columns.

    A column is removed if its largest entry is below the smallest entries of k + 1 others.
    """
    largest_count = np.int64(0)
    for m in range(some):
        least = table[0, m]
        for b in range(1, rows):
            least = min(least, table[b, m])
        largest_count = insert_sorted(largest, who, largest_count, np.float64(-least), m)
    bar = -largest[largest_count - 1] if largest_count == largest.shape[0] else 0.0
    kept_count = 0
    for m in range(some):
        most = table[0, m]
        for b in range(1, rows):
            most = max(most, table[b, m])
        if most > 0.0 and most >= bar:
            union[kept_count] = union[m]
            for b in range(rows):
                table[b, kept_count] = table[b, m]
            kept_count += 1
    return kept_count
