"""Tests of splitting vertices at creases: boards are flat, balls are smooth, and no face is lost."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_viewer.render.surface import cluster_faces, is_closed, split_creases


def ball(rows: int = 12, columns: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Returns a closed unit ball."""
    polar = np.linspace(0, np.pi, rows + 1)[1:-1]
    around = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    ring = np.stack([np.cos(around), np.zeros(columns), -np.sin(around)], -1)
    middle = np.sin(polar)[:, None, None] * ring + np.cos(polar)[:, None, None] * np.array([0, 1, 0])
    vertices = np.vstack([middle.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    faces = []
    for c in range(columns):
        d = (c + 1) % columns
        faces.append((len(vertices) - 2, c, d))
        faces.append((len(vertices) - 1, (rows - 2) * columns + d, (rows - 2) * columns + c))
        for r in range(rows - 2):
            a, b = r * columns + c, r * columns + d
            faces += [(a, a + columns, b), (b, a + columns, b + columns)]
    return vertices.astype(np.float32), np.array(faces, np.int32)


def test_a_box_gets_three_normals_a_corner(make_box) -> None:
    surface = split_creases(*make_box((0, 0, 0), (1, 2, 3)))
    assert len(surface.source) == 24
    assert np.allclose(np.sort(np.abs(surface.normals), 1), [0, 0, 1], atol=1e-6)


def test_normals_point_outwards_where_faces_do(make_box) -> None:
    vertices, faces = make_box((-1, -1, -1), (1, 1, 1))
    surface = split_creases(vertices, faces)
    assert (np.einsum("ij,ij->i", vertices[surface.source], surface.normals) > 0.5).all()


def test_a_ball_is_smooth() -> None:
    vertices, faces = ball()
    surface = split_creases(vertices, faces)
    assert len(surface.source) == len(vertices)
    assert (np.einsum("ij,ij->i", vertices[surface.source], surface.normals) > 0.99).all()


def test_unshared_vertices_are_smooth_all_the_same() -> None:
    vertices, faces = ball()
    soup, loose = vertices[faces].reshape(-1, 3), np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    surface = split_creases(soup, loose)
    assert (np.einsum("ij,ij->i", soup[surface.source], surface.normals) > 0.99).all()


def test_faces_keep_their_corners(make_box) -> None:
    vertices, faces = make_box((0, 0, 0), (1, 1, 1))
    surface = split_creases(vertices, faces)
    assert np.array_equal(surface.source[surface.faces], faces)


def test_face_without_area_is_tolerated() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], np.float32)
    surface = split_creases(vertices, np.array([[0, 1, 2], [0, 1, 3], [1, 1, 2]], np.int32))
    assert np.isfinite(surface.normals).all()
    assert np.allclose(np.linalg.norm(surface.normals, axis=1), 1, atol=1e-5)


def test_only_an_outward_closed_mesh_is_closed(make_box) -> None:
    vertices, faces = make_box((0, 0, 0), (1, 1, 1))
    assert is_closed(vertices, faces)
    assert not is_closed(vertices, faces[:, ::-1])
    assert not is_closed(vertices, faces[1:])
    assert not is_closed(vertices, np.vstack([faces, faces[:1]]))


def test_clusters_are_fewer_faces_of_the_same_vertices() -> None:
    vertices, faces = ball()
    coarse = cluster_faces(vertices, faces, 0.6)
    assert 0 < len(coarse) < len(faces) / 2
    assert set(np.unique(coarse)) <= set(range(len(vertices)))


def test_a_mesh_smaller_than_a_cluster_keeps_its_faces(make_box) -> None:
    vertices, faces = make_box((0.1, 0.1, 0.1), (0.2, 0.2, 0.2))
    assert np.array_equal(cluster_faces(vertices, faces, 10.0), faces)


def slow_groups(vertices: np.ndarray, faces: np.ndarray, crease: float) -> set[frozenset[int]]:
    """Returns corners (numbers 3 f + k) that share a normal, found from neighbours at an edge, face by
    face.
    """
    normals = []
    for f in faces:
        a, b, c = vertices[f].astype(float)
        n = np.cross(b - a, c - a)
        normals.append(n / np.linalg.norm(n) if np.linalg.norm(n) > 1e-14 else np.zeros(3))
    group = {k: {k} for k in range(3 * len(faces))}
    last: dict[frozenset[tuple[float, ...]], int] = {}
    for f, face in enumerate(faces):
        for k in range(3):
            ends = [tuple(vertices[face[i]].tolist()) for i in (k, (k + 1) % 3)]
            g = last.get(frozenset(ends))
            last[frozenset(ends)] = f
            if g is None or len(set(ends)) < 2 or normals[f] @ normals[g] < math.cos(crease):
                continue
            for end, i in zip(ends, (k, (k + 1) % 3), strict=True):
                other = next(j for j in range(3) if tuple(vertices[faces[g, j]].tolist()) == end)
                joined = group[3 * f + i] | group[3 * g + other]
                for corner in joined:
                    group[corner] = joined
    return {frozenset(corners) for corners in group.values()}


@settings(max_examples=30, deadline=None)
@given(st.integers(4, 14), st.integers(1, 30), st.integers(0, 10**6), st.floats(0.1, 2.0))
def test_shared_corner_normals_match_the_slow_reference(
    count: int, triangles: int, seed: int, crease
) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.integers(0, 3, (count, 3)).astype(np.float32)
    vertices[rng.integers(0, count, 2)] = -0.0
    triples = np.array([rng.choice(count, 3, replace=False) for _ in range(triangles)], np.int32)
    distinct = [len({tuple(v) for v in vertices[t].tolist()}) == 3 for t in triples]
    faces = triples[distinct]
    if not len(faces):
        return
    surface = split_creases(vertices, faces, crease)
    groups = defaultdict(set)
    for k, group in enumerate(surface.groups.reshape(-1)):
        groups[int(group)].add(k)
    assert {frozenset(corners) for corners in groups.values()} == slow_groups(vertices, faces, crease)
    np.testing.assert_array_equal(surface.source[surface.faces], faces)
    np.testing.assert_array_equal(surface.group[surface.faces], surface.groups)


def test_a_fan_of_many_faces_is_smooth_in_one_piece() -> None:
    around = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    vertices = np.vstack([[0, 0.1, 0], np.stack([np.cos(around), 0 * around, -np.sin(around)], -1)])
    k = np.arange(200)
    faces = np.stack([np.zeros(200, int), 1 + k, 1 + (k + 1) % 200], 1).astype(np.int32)
    surface = split_creases(vertices.astype(np.float32), faces)
    assert len(surface.source) == 201
    assert (surface.normals[:, 1] > 0.9).all()
