"""Fits the skinning weights of each vertex: at most four, non-negative, with sum one.

B. H. Le and Z. Deng, "Smooth skinning decomposition with rigid bones", 2012, section 4.1: if the transforms
are known, each vertex is a separate least-squares problem. Let d_k(t) be the difference between the vertex
moved by transform k at time t and its true position. Then w minimizes sum_t |sum_k w_k d_k(t)|² = w' D w,
since the weights sum to one. This module adds two rules to the paper. A smoothness term pulls the weights
towards the mean of the neighbours' weights. The old weights are kept if the new weights are not better.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_MAX_TRANSFORMS_PER_VERTEX = 4
"""Maximum number of transforms per vertex. A joint set in glTF and the viewer's shader support four."""


@njit(cache=True, nogil=True)
def fit_weights(rest, wanted, pivots, maps, candidates, near, starts, smooth, indices, weights):
    """Improves ``indices`` (V, 4) int32 and ``weights`` (V, 4) in place, vertex by vertex.

    Args:
        rest: (V, 3).
        wanted: (V, 3 F) positions of the vertices, frame by frame.
        pivots: (K, 3).
        maps: (K, 4, 3 F) affine maps: x = (v - pivot, 1) map.
        candidates: (V, C) int32, -1 for none.
        near, starts: adjacency list; the neighbours of vertex v are near[starts[v]:starts[v + 1]].
        smooth: weight of the smoothness term: square metres, summed over all frames, per squared difference
            from the neighbours' weights.
    """
    count, most = len(rest), candidates.shape[1]
    old_indices, old_weights = indices.copy(), weights.copy()
    away = np.empty((most, wanted.shape[1]))
    gram = np.empty((most, most))
    pull = np.empty(most)
    trial = np.empty(most)
    room = np.empty((most, most + 2))
    free = np.empty(most, np.bool_)
    for v in range(count):
        # Build the Gram matrix D of the candidates' errors over all frames.
        candidate_count = 0
        while candidate_count < most and candidates[v, candidate_count] >= 0:
            candidate_count += 1
        for c in range(candidate_count):
            k = candidates[v, c]
            _transform_differences(rest[v] - pivots[k], maps[k], wanted[v], away[c])
            for d in range(c + 1):
                gram[c, d] = gram[d, c] = _dot_product(away[c], away[d])
        # Collect the old weights of the candidates, and the cost of changing them.
        _mean_neighbour_weights(v, candidates, candidate_count, near, starts, old_indices, old_weights, pull)
        for c in range(candidate_count):
            trial[c] = 0.0
            for s in range(_MAX_TRANSFORMS_PER_VERTEX):
                if old_weights[v, s] > 0.0 and old_indices[v, s] == candidates[v, c]:
                    trial[c] += old_weights[v, s]
        before = _weights_cost(gram, trial, pull, smooth, candidate_count)
        old_sum = 0.0
        for c in range(candidate_count):
            old_sum += trial[c]
        # Solve. Keep the old weights if there is no solution, or no better one.
        if not solve_bounded(gram, pull, smooth, candidate_count, free, room, trial):
            continue
        if abs(old_sum - 1.0) < 1e-6 and _weights_cost(gram, trial, pull, smooth, candidate_count) >= before:
            continue
        # Store the positive weights, and clear the remaining slots.
        slot = 0
        for c in range(candidate_count):
            if trial[c] > 0.0:
                indices[v, slot], weights[v, slot] = candidates[v, c], trial[c]
                slot += 1
        for s in range(slot, _MAX_TRANSFORMS_PER_VERTEX):
            indices[v, s], weights[v, s] = 0, 0.0


@njit(cache=True, nogil=True, fastmath=True)
def _transform_differences(at, own, wanted, out):
    """Writes the differences between a moved vertex and its true positions ``wanted`` (3 F,) to ``out`` (3
    F,). The vertex is at ``at`` (3,) relative to the pivot at rest, and ``own`` (4, 3 F) moves it.
    """
    x, y, z = at
    for j in range(len(out)):
        out[j] = own[3, j] + x * own[0, j] + y * own[1, j] + z * own[2, j] - wanted[j]


@njit(cache=True, nogil=True, fastmath=True)
def _dot_product(a, b):
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@njit(cache=True, nogil=True)
def solve_bounded(gram, pull, smooth, there, free, room, found):
    """Solves for the weights of one vertex, at most four above zero, and writes them to ``found``. Returns
    False if no solution exists.

    First, negative weights are set to zero, the lowest first. Then the smallest weights are set to zero until
    four are left.
    """
    scale = 0.0
    for c in range(there):
        free[c] = True
        scale += gram[c, c]
    if there == 0:
        return False
    least = 1e-10 * scale / there + 1e-300
    left = there
    while True:
        if not _solve_sum_one(gram, pull, smooth, least, there, free, room, found):
            return False
        lowest = -1
        for c in range(there):
            if free[c] and (lowest < 0 or found[c] < found[lowest]):
                lowest = c
        if found[lowest] < 0.0 or left > _MAX_TRANSFORMS_PER_VERTEX:
            free[lowest] = False
            left -= 1
        else:
            return True


@njit(cache=True, nogil=True)
def _solve_sum_one(gram, pull, smooth, least, there, free, room, found):
    """Solves for the free weights with sum one, and sets the other weights to 0. The constraint is met by
    combining the solutions of two right-hand sides.
    """
    # Collect the free weights, and build their matrix with two right-hand sides: pull, and ones.
    n = 0
    order = np.empty(there, np.int64)
    for c in range(there):
        found[c] = 0.0
        if free[c]:
            order[n] = c
            n += 1
    for i in range(n):
        for j in range(i + 1):
            room[i, j] = gram[order[i], order[j]]
        room[i, i] += smooth + least
        room[i, n], room[i, n + 1] = smooth * pull[order[i]], 1.0
    # Cholesky factorization with forward substitution of both right-hand sides.
    for i in range(n):
        for j in range(i + 1):
            total = room[i, j]
            for k in range(j):
                total -= room[i, k] * room[j, k]
            if i == j:
                if total <= 0.0:
                    return False
                room[i, i] = np.sqrt(total)
            else:
                room[i, j] = total / room[j, j]
        for side in range(n, n + 2):
            for k in range(i):
                room[i, side] -= room[i, k] * room[k, side]
            room[i, side] /= room[i, i]
    # Back substitution.
    for i in range(n - 1, -1, -1):
        for side in range(n, n + 2):
            for k in range(i + 1, n):
                room[i, side] -= room[k, i] * room[k, side]
            room[i, side] /= room[i, i]
    # Combine the two solutions so that the weights sum to one (Lagrange multiplier).
    first, second = 0.0, 0.0
    for i in range(n):
        first += room[i, n]
        second += room[i, n + 1]
    if not second > 0.0:
        return False
    share = (1.0 - first) / second
    for i in range(n):
        found[order[i]] = room[i, n] + share * room[i, n + 1]
    return True


@njit(cache=True, nogil=True)
def _weights_cost(gram, found, pull, smooth, there):
    total = 0.0
    for c in range(there):
        total += smooth * (found[c] - pull[c]) ** 2
        for d in range(there):
            total += found[c] * gram[c, d] * found[d]
    return total


@njit(cache=True, nogil=True)
def _mean_neighbour_weights(v, candidates, there, near, starts, indices, weights, pull):
    """Writes to ``pull`` the mean weights of the neighbours for each candidate of vertex v."""
    for c in range(there):
        pull[c] = 0.0
    around = starts[v + 1] - starts[v]
    if around == 0:
        return
    for e in range(starts[v], starts[v + 1]):
        u = near[e]
        for s in range(_MAX_TRANSFORMS_PER_VERTEX):
            if weights[u, s] > 0.0:
                for c in range(there):
                    if candidates[v, c] == indices[u, s]:
                        pull[c] += weights[u, s] / around
