"""Tests of finding faces that intersect other faces, against a test of every pair of faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.arap.self_intersection import SelfIntersection, find_new_intersections
from enliven.meshes.mesh import Mesh


def crossing_faces(vertices, faces):
    """Returns (K,) the faces of a surface that intersect others."""
    return SelfIntersection(Mesh(vertices, faces)).find_crossing_faces(vertices)


def ball(radius=0.5, centre=(0.0, 0.0, 0.0), rings=6, around=9):
    polar, turn = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(turn),
            np.cos(polar)[:, None] * np.ones(around),
            np.sin(polar)[:, None] * np.sin(turn),
        ],
        -1,
    ).reshape(-1, 3)
    last, faces = len(ring), []
    for k in range(around):
        n = (k + 1) % around
        faces += [[last, n, k], [last + 1, last - around + k, last - around + n]]
        for r in range(rings - 2):
            a, b, c, d = r * around + k, r * around + n, (r + 1) * around + k, (r + 1) * around + n
            faces += [[a, b, d], [a, d, c]]
    points = np.concatenate([ring, [[0, 1.0, 0], [0, -1.0, 0]]]) * radius + np.asarray(centre)
    return Mesh(points, np.array(faces, np.int32))


def together(*meshes):
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def twin(vertices, faces):
    """Returns the intersections of every edge with every other face, as positions on the edge and on the
    face.
    """
    crossing = set()
    for f, corners in enumerate(faces):
        for g, others in enumerate(faces):
            p, q = vertices[corners], vertices[others]
            if f == g or (p[:, None] == q[None]).all(2).any():
                continue
            for k in range(3):
                way = p[(k + 1) % 3] - p[k]
                matrix = np.stack([-way, q[1] - q[0], q[2] - q[0]], 1)
                if abs(np.linalg.det(matrix)) < 1e-14:
                    continue
                t, u, v = np.linalg.solve(matrix, p[k] - q[0])
                if 0 < t < 1 and u > 0 and v > 0 and u + v < 1:
                    crossing |= {f, g}
    return sorted(crossing)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_random_faces_are_the_slow_twins(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(40, 3))
    faces = np.array([rng.choice(40, 3, replace=False) for _ in range(30)], np.int32)
    assert crossing_faces(vertices, faces).tolist() == twin(vertices, faces)


@pytest.mark.slow
def test_two_balls_cross_in_a_ring_and_not_inside():
    mesh = together(ball(), ball(centre=(0.7, 0.03, 0.05)))
    crossing = crossing_faces(mesh.vertices, mesh.faces)
    assert crossing.tolist() == twin(mesh.vertices, mesh.faces)
    middles = mesh.vertices[mesh.faces[crossing]].mean(1)
    assert len(crossing) > 8 and np.abs(middles[:, 0] - 0.35).max() < 0.3
    inside = together(ball(), ball(0.2))
    assert len(crossing_faces(inside.vertices, inside.faces)) == 0


def test_slightly_bent_surface_has_no_self_intersection():
    mesh = ball(rings=12, around=20)
    assert len(crossing_faces(mesh.vertices, mesh.faces)) == 0
    assert len(crossing_faces(mesh.vertices * [1.0, 3.0, 0.5] + 4.0, mesh.faces)) == 0


def test_split_vertices_are_neighbours_still():
    mesh = ball()
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    assert len(crossing_faces(soup.vertices, soup.faces)) == 0


def test_faces_in_one_plane_or_touching_do_not_cross():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0.2, 0.2, 0], [1.0, 0.2, 0], [0.2, 1.0, 0]])
    assert len(crossing_faces(square, np.array([[0, 1, 2], [3, 4, 5]], np.int32))) == 0
    square[3:] += [[0, 0, 0], [0, 0, 1], [0, 0, 1]]
    assert len(crossing_faces(square, np.array([[0, 1, 2], [3, 4, 5]], np.int32))) == 0
    square[3] -= [0, 0, 0.1]
    assert crossing_faces(square, np.array([[0, 1, 2], [3, 4, 5]], np.int32)).tolist() == [0, 1]


def test_intersections_at_rest_are_not_reported():
    mesh = together(ball(), ball(centre=(0.7, 0.03, 0.05)), ball(0.3, (3.0, 0.0, 0.0)))
    crossing = SelfIntersection(mesh)
    assert len(crossing.find_new_crossing_faces(mesh.vertices)) == 0
    moved = mesh.vertices.copy()
    moved[-len(ball().vertices) :] -= [3.5, 0.0, 0.0]
    now = crossing.find_new_crossing_faces(moved)
    assert len(now) and len(np.intersect1d(now, crossing.find_crossing_faces(mesh.vertices))) == 0
    assert np.array_equal(
        now,
        find_new_intersections(
            crossing.find_crossing_faces(mesh.vertices), crossing_faces(moved, mesh.faces)
        ),
    )


@pytest.mark.parametrize("count", [0, 1, 3])
def test_few_faces_are_handled(count):
    vertices = np.arange(27.0).reshape(9, 3) ** 2
    assert len(crossing_faces(vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3))) == 0
