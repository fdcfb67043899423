"""Tests of geodesic extremities: shortest paths over the surface end at hands, feet and head."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.camera import world_from_level_camera
from enliven.person.joints import Joint
from enliven_edge.tracking.detect.extremities import DEPTH_EDGE_COST_M, extend_distances, find_extremities
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.training.body_poses import random_figure
from enliven_synthesis.training.rendering import PersonRenderer


def slow_distances(points: np.ndarray, z: np.ndarray, mask: np.ndarray, step: int, source: int) -> np.ndarray:
    """Returns the same distances by SciPy's Dijkstra on an explicit graph."""
    height, width = mask.shape
    rows, columns, costs = [], [], []
    for v in range(height):
        for u in range(width):
            for q in range(max(0, v - 1), min(height, v + 2)):
                for p in range(max(0, u - 1), min(width, u + 2)):
                    if (q, p) != (v, u) and mask[v, u] and mask[q, p]:
                        cost = np.linalg.norm(points[q, p] - points[v, u])
                        jump = abs(z[q, p] - z[v, u]) > step * (0.02 + 0.008 * z[v, u] ** 2)
                        rows.append(v * width + u)
                        columns.append(q * width + p)
                        costs.append(cost + DEPTH_EDGE_COST_M * jump)
    graph = csr_matrix((costs, (rows, columns)), (height * width, height * width))
    return dijkstra(graph, indices=source).reshape(height, width)


@given(st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_distances_are_dijkstras(seed):
    dice = np.random.default_rng(seed)
    mask = dice.random((9, 8)) < 0.75
    z = 2.0 + 0.3 * (dice.random((9, 8)) < 0.2) + 0.01 * dice.random((9, 8))
    v, u = np.mgrid[:9, :8] * 0.03
    points = np.stack([u, -v, z], -1)
    source = int(np.flatnonzero(mask)[0])
    distances = np.full(mask.shape, np.inf)
    extend_distances(points, z, mask, 1, source, distances)
    slow = slow_distances(points, z, mask, 1, source)
    assert np.allclose(distances[mask], slow[mask])
    assert np.isinf(distances[~mask]).all()


def test_hands_feet_and_head_are_the_extremities_of_a_star():
    dice = np.random.default_rng(3)
    performer = Performer(Proportions(1.7))
    figure = random_figure(performer, dice, 0.0, "side lunge", "out")
    pose = world_from_level_camera(1.0)
    pose[2, 3] = 3.0
    picture = PersonRenderer().render_figure(performer, figure, 1, pose, dice)
    z = picture.z.astype(float)
    tips = find_extremities(z, z > 0, picture.camera, pose)
    ends = [Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT]
    for end in ends:
        assert np.linalg.norm(tips.points - figure.joints[end], axis=1).min() < 0.2, end.name
    assert (np.diff(tips.surface_distances) <= 1e-9).all(), "the farthest come first"


def test_empty_mask_has_no_extremities():
    z = np.zeros((20, 20))
    assert len(find_extremities(z, z > 0, np.array([100.0, 100, 10, 10]), np.eye(4)).points) == 0
