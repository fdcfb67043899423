"""Tests of edge flips: neighbours equal those found by comparing edges, and a second flip restores the first
edge.
"""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from enliven.meshes.flips import flip, slot


def neighbours(triangles: np.ndarray) -> np.ndarray:
    """Returns the neighbours of triangles, found by comparing edges. It is a slow reference for
    ``beside``.
    """
    edges = {(t[(k + 1) % 3], t[(k + 2) % 3]): i for i, t in enumerate(triangles.tolist()) for k in range(3)}
    return np.array(
        [[edges.get((t[(k + 2) % 3], t[(k + 1) % 3]), -1) for k in range(3)] for t in triangles.tolist()]
    )


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 10_000))
def test_a_flip_keeps_neighbours_right_and_undoes_itself(seed, which):
    points = np.random.default_rng(seed).uniform(size=(12, 2))
    triangles = Delaunay(points).simplices.astype(np.int64)
    corners = points[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    beside = neighbours(triangles)
    inner = np.argwhere(beside >= 0)
    t, k = inner[which % len(inner)]
    u = beside[t, k]
    before = {frozenset(row) for row in triangles.tolist()}
    other = {triangles[t, k], triangles[u, slot(beside[u], t)]}
    assume(not any(other <= set(row) for row in triangles.tolist()))  # an edge twice is not for flip to see
    edge = {triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]}
    flip(triangles, beside, t, k)
    np.testing.assert_array_equal(beside, neighbours(triangles))
    assert not any(edge <= set(row) for row in triangles.tolist())
    flip(triangles, beside, t, slot(beside[t], u))
    np.testing.assert_array_equal(beside, neighbours(triangles))
    assert {frozenset(row) for row in triangles.tolist()} == before
