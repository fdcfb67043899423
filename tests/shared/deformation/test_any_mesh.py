"""Tests that any mesh gets a connected deformation graph that every vertex follows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven.deformation.graph.connectivity import label_components
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.graph.surface import build_net
from enliven.meshes.mesh import Mesh, fit_height


def ball(centre, radius, rings=7):
    """Returns a closed shell."""
    up, turn = np.meshgrid(
        np.linspace(0.2, np.pi - 0.2, rings), np.arange(2 * rings) * np.pi / rings, indexing="ij"
    )
    points = np.stack([np.sin(up) * np.cos(turn), np.cos(up), np.sin(up) * np.sin(turn)], -1).reshape(-1, 3)
    n = np.arange(rings * 2 * rings).reshape(rings, -1)
    a, b, c, d = n[:-1], np.roll(n, -1, 1)[:-1], n[1:], np.roll(n, -1, 1)[1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])
    return centre + radius * points, faces


def random_mesh(seed):
    """Returns a random mixture of shells, loose triangles, slivers, and doubled or unused vertices, at any
    size.
    """
    rng = np.random.default_rng(seed)
    vertices, faces, count = [], [], 0
    for _ in range(rng.integers(0, 4)):
        points, shell = ball(rng.normal(size=3), rng.uniform(0.05, 0.8), int(rng.integers(3, 9)))
        if rng.random() < 0.3:
            shell = shell[: len(shell) // 2]  # a one-sided scan
        if rng.random() < 0.3:
            points, shell = points[shell.reshape(-1)], np.arange(3 * len(shell)).reshape(-1, 3)  # flat-shaded
        vertices.append(points)
        faces.append(shell + count)
        count += len(points)
    for _ in range(rng.integers(1, 12)):
        triangle = rng.normal(size=(3, 3)) * np.array([1, 1, rng.choice([1.0, 1e-3, 0.0])])
        vertices.append(
            triangle if rng.random() < 0.8 else triangle[[0, 1, 1]] + [[0, 0, 0], [0, 0, 0], [1e-6, 0, 0]]
        )
        faces.append(np.array([[0, 1, 2]]) + count)
        count += 3
    vertices.append(rng.normal(size=(2, 3)))
    size = 2.0 ** rng.integers(-12, 12)
    return Mesh(np.concatenate(vertices) * size, np.concatenate(faces).astype(np.int32), "random")


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
def test_any_mesh_gets_a_connected_graph_and_whole_weights(seed, nodes):
    mesh = random_mesh(seed)
    graph = DeformationGraph.build(mesh, nodes)
    assert len(graph.positions) == nodes
    assert label_components(nodes, graph.edges).max() == 0
    assert len(np.unique(graph.edges, axis=0)) == len(graph.edges)
    assert (graph.edges[:, 0] < graph.edges[:, 1]).all()
    np.testing.assert_allclose(np.linalg.norm(graph.normals, axis=1), 1)
    # Each node lies on the face that it names.
    a, b, c = (mesh.vertices[mesh.faces[graph.faces, k]] for k in range(3))
    offset = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    parts = [
        np.linalg.norm(np.cross(p - graph.positions, q - graph.positions), axis=1)
        for p, q in ((a, b), (b, c), (c, a))
    ]
    longest = np.max([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], 0)
    np.testing.assert_allclose(np.sum(parts, 0), offset, atol=1e-9 * float(longest.max()) ** 2)
    skin = character_from_graph(mesh, graph, "random").skin
    assert np.isfinite(skin.weights).all()
    assert skin.weights.min() >= 0
    np.testing.assert_allclose(skin.weights.sum(1), 1, atol=1e-6)
    assert (np.diff(skin.weights, axis=1) <= 1e-6).all()


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_the_same_mesh_and_one_that_is_a_power_of_two_larger_give_the_same_graph(seed):
    mesh = random_mesh(seed)
    first, again = DeformationGraph.build(mesh, 30), DeformationGraph.build(mesh, 30)
    large = Mesh(mesh.vertices * 256, mesh.faces)
    larger = DeformationGraph.build(large, 30)
    for other, factor in ((again, 1), (larger, 256)):
        np.testing.assert_array_equal(other.positions, first.positions * factor)
        np.testing.assert_array_equal(other.edges, first.edges)
        np.testing.assert_array_equal(other.rigid, first.rigid)
    skins = [g.skin(m) for g, m in ((first, mesh), (again, mesh), (larger, large))]
    for skin in skins[1:]:
        np.testing.assert_array_equal(skin.indices, skins[0].indices)
        np.testing.assert_allclose(skin.weights, skins[0].weights, atol=1e-5)


def test_skin_weights_are_equal_for_cached_and_copied_mesh():
    """Weights are equal if several vertices are requested at once, and for an equal mesh that is a different
    object.
    """
    mesh = Mesh(*ball(np.zeros(3), 0.5, 12))
    graph = DeformationGraph.build(mesh, 40)
    assert graph.cells is not None and graph.cells.net.mesh is mesh
    copy = Mesh(mesh.vertices.copy(), mesh.faces.copy())
    assert_alike(graph.skin(mesh).weights, graph.skin(copy).weights, SOLVER_TOLERANCE)
    assert "cells" not in repr(graph)


def sheet(count, size=1.0):
    """Returns a square in one plane."""
    grid = np.stack(np.meshgrid(np.linspace(0, size, count), np.linspace(0, size, count), indexing="ij"), -1)
    n = np.arange(count * count).reshape(count, count)
    quads = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], -1).reshape(-1, 4)
    points = np.column_stack([grid.reshape(-1, 2), np.zeros(count * count)])
    return Mesh(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), "sheet")


@pytest.mark.parametrize("size", [1.0, 0.08, 1e-5, 1e4])
def test_plane_of_any_size_gets_a_graph(size):
    mesh = sheet(30, size)
    graph = DeformationGraph.build(mesh, 50)
    assert label_components(50, graph.edges).max() == 0
    assert not graph.bridges.any()
    longest = np.linalg.norm(graph.positions[graph.edges[:, 0]] - graph.positions[graph.edges[:, 1]], axis=1)
    assert longest.max() < 3 * size / np.sqrt(50)
    np.testing.assert_allclose(graph.skin(mesh).weights.sum(1), 1, atol=1e-6)


def test_tiny_mesh_gets_a_graph():
    mesh = fit_height(Mesh(*ball(np.zeros(3), 1.0, 16)), 0.05)
    graph = DeformationGraph.build(mesh, 64)
    assert label_components(64, graph.edges).max() == 0
    assert graph.radius < 0.03
    by_radius = DeformationGraph.build(mesh, radius=0.02)
    assert 5 < len(by_radius.positions) < 200


def test_two_sheets_that_touch_hang_together_and_two_apart_by_one_joint():
    first = sheet(20)
    for gap, bridges in ((0.001, 0), (0.6, 1)):
        other = first.vertices + np.array([1.0 + gap, 0, 0])
        mesh = Mesh(np.concatenate([first.vertices, other]), np.concatenate([first.faces, first.faces + 400]))
        graph = DeformationGraph.build(mesh, 60)
        side = graph.positions[:, 0] > 1 + gap / 2
        crossing = side[graph.edges[:, 0]] != side[graph.edges[:, 1]]
        assert graph.bridges.sum() == bridges
        assert crossing.sum() == 1 if bridges else crossing.sum() > 2


@pytest.mark.slow
def test_a_soup_of_very_many_pieces_is_one_net():
    """Loose triangles with hundreds per grid cell: the graph must not have a node for each."""
    rng = np.random.default_rng(1)
    centres = rng.normal(size=(25_000, 1, 3))
    centres /= np.linalg.norm(centres, axis=2, keepdims=True)
    corners = (centres + 0.004 * rng.normal(size=(25_000, 3, 3))).reshape(-1, 3)
    mesh = Mesh(corners, np.arange(75_000).reshape(-1, 3), "dust")
    spacing = np.sqrt(4 * np.pi / 64)
    net = build_net(mesh, spacing)
    assert len(net.points) < 9000
    assert np.linalg.norm(mesh.vertices - net.points[net.of_vertex], axis=1).max() < 2 * net.cell
    graph = DeformationGraph.build(mesh, 64)
    assert label_components(64, graph.edges).max() == 0
    followed = graph.positions[graph.skin(mesh).indices[:, 0]]
    assert np.linalg.norm(mesh.vertices - followed, axis=1).max() < 1.0
