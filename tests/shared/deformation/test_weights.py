"""Tests of blending weights: they are local, linear, and continuous along the surface."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair
from sample_meshes.isosurface import surface_of
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.deformation.graph.graph import DeformationGraph
from enliven.deformation.graph.surface import build_net, path_lengths
from enliven.deformation.graph.weights import choose_followed_nodes
from enliven.meshes.mesh import Mesh, refine


def capsules(points, ends, radius):
    def one(a, b):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        return np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - radius

    return np.min([one(np.array(a), np.array(b)) for a, b in ends], 0)


FORK = [
    ((-0.1, 0.05, 0.0), (-0.1, 0.6, 0.0)),
    ((0.1, 0.05, 0.0), (0.1, 0.6, 0.0)),
    ((-0.1, 0.6, 0.0), (0.1, 0.6, 0.0)),
]


def fork(cell):
    """Returns two prongs 10 cm apart on one handle."""
    low, high = np.array([-0.2, -0.05, -0.1]), np.array([0.2, 0.7, 0.1])
    return Mesh(*surface_of(lambda p: capsules(p, FORK, 0.05), low, high, cell), "fork")


@pytest.fixture(scope="module")
def coarse():
    return fork(0.02)


def slow_weights(mesh, graph, spacing):
    """Returns (V, N) weights by the three steps of the module's docstring, on the mesh itself instead of a
    coarse net.
    """
    net = build_net(mesh, spacing)
    assert (net.radii == 0).all(), net.radii
    cells = graph.cells
    count, nodes = len(net.points), len(graph.positions)

    def ways_over(web, size, sources):
        a, b = web.edges.T
        return dijkstra(csr_matrix((web.lengths, (a, b)), (size, size)), directed=False, indices=sources)

    ways = ways_over(cells.graph, count + nodes, count + np.arange(nodes))[:, :count].T
    followed = choose_followed_nodes(
        graph.positions, path_lengths(nodes, cells.borders, cells.lengths), spacing
    )
    straight = np.linalg.norm(net.points[:, None] - graph.positions, axis=2)
    distance = straight + 2 * np.maximum(0, ways - 1.5 * straight - spacing / 2)
    steep = np.zeros((count, nodes))
    for v, row in enumerate(distance):
        near = followed[np.argsort(row[followed], kind="stable")[:5]]
        most = min(row[near[4]], max(2 * spacing, 1.5 * row[near[0]]))
        fall = np.maximum(0, 1 - row[near[:4]] / most)
        steep[v, near[:4]] = fall / fall.sum()
    between = ways_over(net.graph, count, np.arange(count))
    radius = 0.6 * spacing
    share = np.where(between < radius, (1 - (between / radius) ** 2) ** 2, 0)
    mean = (share @ steep) / share.sum(1, keepdims=True)
    apart = np.linalg.norm(mesh.vertices[:, None] - net.points, axis=2)[:, :]
    close = np.maximum(0, 1 - (apart / (1.8 * net.cell)) ** 2) ** 2
    close[between[net.of_vertex] > 2.7 * net.cell] = 0
    mean = close @ mean
    fifth = np.sort(mean, 1)[:, -5:-4]
    kept = np.maximum(0, mean - fifth)
    return kept / kept.sum(1, keepdims=True)


def dense(skin, nodes):
    out = np.zeros((len(skin.indices), nodes))
    np.add.at(out, (np.arange(len(out))[:, None], skin.indices.astype(int)), skin.weights)
    return out


def folded(step=0.024):
    """Returns a sheet folded into a U as a regular grid, with 10 cm between its wings."""
    along = np.arange(0, 1.1, step)
    turn = np.clip((along - 0.45) / 0.05, 0, np.pi)
    y = np.minimum(along, 0.45) + 0.05 * np.sin(turn) - np.maximum(along - 0.45 - 0.05 * np.pi, 0)
    z = 0.05 * (1 - np.cos(turn))
    across = np.arange(0, 0.3, step)
    n = np.arange(len(along) * len(across)).reshape(len(along), -1)
    vertices = np.stack(
        [np.tile(across, len(along)), np.repeat(y, len(across)), np.repeat(z, len(across))], 1
    )
    corners = np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], -1).reshape(-1, 4)
    return Mesh(vertices, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]), "fold")


@pytest.mark.slow
@pytest.mark.parametrize("nodes", [24, 60])
def test_weights_match_their_definition(nodes):
    mesh = folded()
    graph = DeformationGraph.build(mesh, nodes)
    expected = slow_weights(mesh, graph, np.sqrt(mesh.area / nodes))
    np.testing.assert_allclose(dense(graph.skin(mesh), nodes), expected, atol=2e-5)
    plain = np.linalg.norm(mesh.vertices[:, None] - graph.positions, axis=2).argmin(1)
    # Shows that the test is meaningful: the wings are so near that Euclidean distances would mix them.
    assert (plain != expected.argmax(1)).sum() > 10


@pytest.mark.slow
def test_a_finer_mesh_of_the_same_surface_has_nearly_the_same_weights(coarse):
    """The net of the fine mesh consists of vertex clusters, that of the coarse mesh of vertices."""
    fine = refine(coarse, 0.004)
    whole = DeformationGraph.build(coarse, 24)
    spacing = np.sqrt(coarse.area / 24)
    assert (build_net(fine, spacing).radii > 0).mean() > 0.9
    graph = DeformationGraph(
        *(getattr(whole, name) for name in ("positions", "normals")),
        np.array(
            [np.abs(fine.vertices[fine.faces].mean(1) - p).sum(1).argmin() for p in whole.positions], np.int32
        ),
        *(getattr(whole, name) for name in ("edges", "rigid", "bridges", "cut_vertices", "radius")),
    )
    apart = np.abs(dense(graph.skin(fine), 24)[: len(coarse.vertices)] - dense(whole.skin(coarse), 24)).sum(1)
    assert np.quantile(apart, 0.95) < 0.15
    assert apart.mean() < 0.05


def jumps(mesh, skin, nodes):
    """Returns (E,) differences between the weights of neighbouring vertices, and (E,) their distances."""
    weights = dense(skin, nodes)
    a, b = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).T
    return np.abs(weights[a] - weights[b]).sum(1), np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)


@pytest.mark.slow
def test_weights_are_continuous():
    """Differences shrink with shorter edges. At a discontinuity, the maximum difference would stay the
    same.
    """
    mesh = fork(0.02)
    nodes, largest = 24, []
    graph = DeformationGraph.build(mesh, nodes)
    for longest in (0.02, 0.005):
        fine = refine(mesh, longest)
        # The same nodes on the finer mesh, so that only the resolution changes.
        faces = [np.abs(fine.vertices[fine.faces].mean(1) - p).sum(1).argmin() for p in graph.positions]
        same = DeformationGraph(
            graph.positions,
            graph.normals,
            np.array(faces, np.int32),
            graph.edges,
            graph.rigid,
            graph.bridges,
            graph.cut_vertices,
            graph.radius,
        )
        largest.append(jumps(fine, same.skin(fine), nodes)[0].max())
    assert largest[-1] < 0.65 * largest[0]


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(5, 40))
def test_carriers_are_apart_and_near_to_every_node(seed, count):
    rng = np.random.default_rng(seed)
    positions = rng.random((count, 3))
    straight = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    chosen = choose_followed_nodes(positions, straight, 0.5, min_count=1)
    apart = straight[np.ix_(chosen, chosen)] + 9 * np.eye(len(chosen))
    assert apart.min() >= 0.6 * 0.5
    assert straight[:, chosen].min(1).max() < 0.6 * 0.5


def test_few_nodes_carry_all_vertices(coarse):
    for nodes in (1, 2, 4):
        graph = DeformationGraph.build(coarse, nodes)
        assert set(np.unique(graph.skin(coarse).indices)) == set(range(nodes))


@pytest.mark.slow
def test_the_chair_does_not_tear_where_no_node_is_near_another():
    """Neighbouring vertices of the chair follow nearly the same nodes."""
    chair = make_chair()
    differ, _ = jumps(chair, DeformationGraph.build(chair, 128).skin(chair), 128)
    assert np.quantile(differ, 0.999) < 0.65
    assert differ.mean() < 0.13
