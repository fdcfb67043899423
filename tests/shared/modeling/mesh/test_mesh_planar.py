"""Tests of planar triangulations: they cover the outline, are Delaunay, and are refined to even triangles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.meshes.planar import refine_triangulation, triangulate_loops
from enliven.modeling.mesh.caps import HarmonicInterpolation, triangulate_cap
from enliven.modeling.mesh.cut_loops import signed_area

wobbles = st.lists(st.floats(0.4, 1.6), min_size=5, max_size=40)


def flower(radii):
    turn = 2 * np.pi * np.arange(len(radii)) / len(radii)
    return np.stack([np.cos(turn), np.sin(turn)], 1) * np.array(radii)[:, None]


def areas(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def not_delaunay(points, triangles):
    """Returns the inner edges whose two opposite angles sum to more than 180 degrees, found one edge at a
    time.
    """
    opposite = {}
    for a, b, c in triangles.tolist():
        for tip, i, j in ((a, b, c), (b, c, a), (c, a, b)):
            u, v = points[i] - points[tip], points[j] - points[tip]
            angle = np.arccos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1, 1))
            opposite.setdefault(frozenset((i, j)), []).append((angle, tip))
    bad = 0
    for pair, tips in opposite.items():
        if len(tips) == 2 and tips[0][0] + tips[1][0] > np.pi + 1e-4:
            i, j = pair
            quad = [tips[0][1], i, tips[1][1], j]
            turns = [np.cross(*(np.append(points[quad[(k + m) % 4]] - points[quad[k]], 0) for m in (1, 2)))[2]
                     for k in range(4)]  # fmt: skip
            bad += min(turns) > 1e-6 or max(turns) < -1e-6
    return bad


@settings(max_examples=40, deadline=None)
@given(wobbles)
def test_triangulation_covers_outline_and_is_delaunay(radii):
    points = flower(radii)
    triangles = triangulate_loops(points, [np.arange(len(points))])
    assert len(triangles) == len(points) - 2
    sizes = areas(points, triangles)
    assert sizes.min() >= -1e-9
    assert sizes.sum() == pytest.approx(signed_area(points))
    assert not_delaunay(points, triangles) == 0


@settings(max_examples=20, deadline=None)
@given(wobbles)
def test_refining_keeps_the_outline_and_the_area(radii):
    points = flower(radii)
    triangles = triangulate_loops(points, [np.arange(len(points))])
    vertices, cells = refine_triangulation(points, triangles, np.full(len(points), 0.2))
    assert (vertices[: len(points)] == points).all()
    assert areas(vertices, cells).min() >= -1e-9
    assert areas(vertices, cells).sum() == pytest.approx(signed_area(points))
    border = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1)
    edges, counts = np.unique(border, axis=0, return_counts=True)
    assert counts.max() <= 2 and (edges[counts == 1] < len(points)).all()


def test_a_hole_stays_a_hole():
    outer, inner = flower([2.0] * 40), flower([1.0] * 20)[::-1]
    points = np.concatenate([outer, inner])
    cap = triangulate_cap([np.arange(40), 40 + np.arange(20)], points)
    vertices = np.concatenate([points[cap.rim], cap.inner_points(points[cap.rim])])
    assert areas(vertices, cap.faces).sum() == pytest.approx(signed_area(outer) + signed_area(inner))
    assert np.linalg.norm(vertices[cap.faces].mean(1), axis=1).min() > 0.9


@settings(max_examples=20, deadline=None)
@given(wobbles, st.tuples(*[st.floats(-2, 2)] * 3))
def test_cap_interpolates_border_values_linearly(radii, plane):
    points = flower(radii)
    triangles = triangulate_loops(points, [np.arange(len(points))])
    vertices, cells = refine_triangulation(points, triangles, np.full(len(points), 0.3))
    spread = HarmonicInterpolation(vertices, cells, len(points))
    inside = spread(np.eye(len(points)))
    assert len(inside) == spread.count == len(vertices) - len(points)
    assert inside.min(initial=0) >= -1e-9
    np.testing.assert_allclose(inside.sum(1), 1, atol=1e-6)
    height = vertices @ plane[:2] + plane[2]
    np.testing.assert_allclose(spread(height[: len(points)]), height[len(points) :], atol=2e-3)
