"""Tests of the deformation graph: it is connected, local, and does not link parts that are near only through
the air.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair
from sample_meshes.isosurface import surface_of

from enliven.deformation.graph.connectivity import find_joining_edges, find_weak_edges, label_components
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.graph.sampling import find_nearest_surface_points
from enliven.deformation.graph.surface import build_net, path_lengths, voronoi_cells
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh


def capsule(points, a, b, radius):
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - radius


LEGS = [(np.array([x, 0.05, 0.0]), np.array([x, 0.8, 0.0])) for x in (-0.09, 0.09)]
HIP = (np.array([-0.09, 0.8, 0.0]), np.array([0.09, 0.8, 0.0]))


@pytest.fixture(scope="module")
def two_legs():
    """Returns two legs 8 cm apart that are joined only at the hip."""

    def field(points):
        return np.min([capsule(points, a, b, 0.05) for a, b in [*LEGS, HIP]], 0)

    return Mesh(*surface_of(field, np.array([-0.2, -0.05, -0.1]), np.array([0.2, 0.9, 0.1]), 0.012), "legs")


@pytest.fixture(scope="module")
def chair():
    return make_chair()


def side(points):
    """Returns -1 or 1 for points on the lower half of the left or right leg, 0 near the hip."""
    return np.sign(points[:, 0]) * (points[:, 1] < 0.55)


def clamped_shares(corners, point):
    """Returns (F, 3, 1) barycentric coordinates of a point's projection on triangles (F, 3, 3), clamped to
    the triangles.
    """
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    along, across = ((point - a) * u).sum(1), ((point - a) * v).sum(1)
    area = np.maximum(uu * vv - uv * uv, 1e-30)
    second, third = (vv * along - uv * across) / area, (uu * across - uv * along) / area
    shares = np.maximum(np.stack([1 - second - third, second, third], 1), 0.0)
    return (shares / shares.sum(1, keepdims=True))[..., None]


@given(st.integers(0, 10**6), st.floats(0.0, 0.3), st.floats(-1e3, 1e3))
def test_the_nearest_place_is_that_of_all_faces(seed, off, far):
    rng = np.random.default_rng(seed)
    mesh = Mesh(
        rng.normal(size=(12, 3)) + far, np.array([rng.permutation(12)[:3] for _ in range(20)], np.int32)
    )
    on = mesh.vertices[mesh.faces[rng.integers(0, 20, 5)]].mean(1)
    points = on + off * rng.normal(size=(5, 3))
    nearest = find_nearest_surface_points(mesh, points).positions
    for point, place in zip(points, nearest, strict=True):
        shares = clamped_shares(mesh.vertices[mesh.faces], point)
        every = np.linalg.norm((mesh.vertices[mesh.faces] * shares).sum(1) - point, axis=1)
        # A micrometre a kilometre from the origin is rounding.
        assert np.linalg.norm(place - point) <= every.min() + 1e-9


@pytest.mark.parametrize("nodes", [24, 64, 128])
def test_edges_and_weights_do_not_cross_between_legs(two_legs, nodes):
    graph = DeformationGraph.build(two_legs, nodes)
    of_node, of_vertex = side(graph.positions), side(two_legs.vertices)
    assert (of_node[graph.edges].prod(1) >= 0).all()
    skin = graph.skin(two_legs)
    followed = of_node[skin.indices] * (skin.weights > 0)
    assert (followed * of_vertex[:, None] >= 0).all()


def test_euclidean_neighbours_cross_between_legs(two_legs):
    """Shows that the test above is meaningful: links to the four nearest Euclidean neighbours do join the
    legs.
    """
    graph = DeformationGraph.build(two_legs, 64)
    apart = np.linalg.norm(graph.positions[:, None] - graph.positions[None], axis=2)
    nearest = np.argsort(apart, 1)[:, 1:5]
    crossing = side(graph.positions)[:, None] * side(graph.positions)[nearest]
    assert (crossing < 0).any()


@pytest.mark.parametrize("nodes", [1, 2, 3, 5, 9, 128])
def test_graphs_are_connected_and_weights_sum_to_one(chair, nodes):
    graph = DeformationGraph.build(chair, nodes)
    assert len(graph.positions) == nodes
    assert label_components(nodes, graph.edges).max() == 0
    assert (graph.edges[:, 0] < graph.edges[:, 1]).all()
    character = character_from_graph(chair, graph, "chair")
    weights = character.skin.weights
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    assert weights.min() >= 0
    assert (np.diff(weights, axis=1) <= 1e-7).all()
    assert character.kind == "graph"


def test_both_faces_of_a_thin_board_follow_the_same_nodes():
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41), indexing="ij"), -1).reshape(
        -1, 2
    )
    n = np.arange(41 * 41).reshape(41, 41)
    quads = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], -1).reshape(-1, 4)
    up = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    rim = np.concatenate([n[:-1, 0], n[-1, :-1], n[:0:-1, -1], n[0, :0:-1]])
    after = np.roll(rim, -1)
    count = 41 * 41
    walls = np.concatenate(
        [np.stack([rim, rim + count, after], 1), np.stack([after, rim + count, after + count], 1)]
    )
    top = np.column_stack([grid, np.full(count, 0.01)])
    bottom = np.column_stack([grid, np.full(count, -0.01)])
    mesh = Mesh(np.concatenate([top, bottom]), np.concatenate([up, up[:, ::-1] + count, walls]), "board")
    skin = DeformationGraph.build(mesh, 64).skin(mesh)
    dense = np.zeros((2 * count, 64))
    np.put_along_axis(dense, skin.indices.astype(int), skin.weights, 1)
    assert np.abs(dense[:count] - dense[count:]).sum(1).mean() < 0.25


def soup_of(mesh):
    return Mesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), "soup"
    )


def test_a_soup_gets_the_graph_of_its_welded_mesh(two_legs):
    soup = soup_of(two_legs)
    whole, cut = DeformationGraph.build(two_legs, 64), DeformationGraph.build(soup, 64)
    np.testing.assert_array_equal(whole.edges, cut.edges)
    np.testing.assert_array_equal(
        cut.skin(soup).indices, whole.skin(two_legs).indices[two_legs.faces.reshape(-1)]
    )


def test_loose_pieces_without_a_node_follow_the_nearest(two_legs):
    button = np.array([[0.1, 0.3, 0.052], [0.101, 0.3, 0.052], [0.1, 0.301, 0.052]])
    count = len(two_legs.vertices)
    faces = np.concatenate([two_legs.faces, [[count, count + 1, count + 2]]])
    mesh = Mesh(np.concatenate([two_legs.vertices, button]), faces)
    graph = DeformationGraph.build(mesh, 48)
    assert not (graph.faces == len(faces) - 1).any()
    skin = graph.skin(mesh)
    assert (graph.positions[skin.indices[-3:], 0] > 0).all()


def test_shells_are_joined_and_the_joints_are_rigid():
    """Two balls that do not touch get one bridge, on which E_rig acts."""
    first, second = np.zeros(3), np.array([0.0, 1.0, 0.0])

    def field(points):
        return np.minimum(*(np.linalg.norm(points - c, axis=1) - 0.3 for c in (first, second)))

    mesh = Mesh(*surface_of(field, np.full(3, -0.4), np.array([0.4, 1.4, 0.4]), 0.04), "balls")
    graph = DeformationGraph.build(mesh, 40)
    upper = graph.positions[:, 1] > 0.5
    crossing = upper[graph.edges[:, 0]] != upper[graph.edges[:, 1]]
    assert crossing.sum() == 1
    assert graph.bridges[crossing].all()
    assert graph.rigid[crossing].all()
    assert graph.cut_vertices[graph.edges[crossing]].all()
    skin = graph.skin(mesh)
    assert ((mesh.vertices[:, 1] > 0.5) == upper[skin.indices[:, 0]]).all()


def test_a_scan_with_one_side_only_works(two_legs):
    front = two_legs.face_normals()[:, 2] > 0.1
    scan = Mesh(two_legs.vertices, two_legs.faces[front], "scan")
    graph = DeformationGraph.build(scan, 32)
    assert label_components(32, graph.edges).max() == 0
    assert (side(graph.positions)[graph.edges].prod(1) >= 0).all()


def test_a_flat_mesh_and_a_single_triangle_work():
    for nodes in (1, 3, 20):
        mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
        graph = DeformationGraph.build(mesh, nodes)
        assert label_components(nodes, graph.edges).max() == 0
        np.testing.assert_allclose(graph.skin(mesh).weights.sum(1), 1, atol=1e-6)


def test_other_mesh_is_refused(chair, two_legs):
    graph = DeformationGraph.build(chair, 64)
    with pytest.raises(InputError, match="graph was built"):
        graph.skin(Mesh(two_legs.vertices, two_legs.faces[:10]))


def test_the_way_along_the_surface_goes_round(two_legs):
    tips = np.array([[-0.09, 0.0, 0.0], [0.09, 0.0, 0.0]])
    faces = [np.abs(two_legs.vertices[two_legs.faces].mean(1) - tip).sum(1).argmin() for tip in tips]
    cells = voronoi_cells(build_net(two_legs, 0.05), tips, np.array(faces, np.int32))
    way = path_lengths(2, cells.borders, cells.lengths, np.inf)[0, 1]
    assert 1.45 < way < 1.9
    assert (np.sign(two_legs.vertices[:, 0]) == np.sign(cells.owner[cells.net.of_vertex] - 0.5))[
        two_legs.vertices[:, 1] < 0.7
    ].all()


def brute_weak(count, edges):
    """Returns bridges and cut vertices, found by removing each edge and each node in turn."""
    whole = label_components(count, edges).max()
    bridges = [label_components(count, np.delete(edges, e, 0)).max() > whole for e in range(len(edges))]
    cuts = []
    for node in range(count):
        label = label_components(count, edges[~(edges == node).any(1)])
        cuts.append(len(np.unique(np.delete(label, node))) > 1)
    return bridges, cuts


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 14), st.integers(0, 14), st.integers(0, 2**32 - 1))
def test_bridges_and_cut_vertices_against_brute_force(count, extra, seed):
    rng = np.random.default_rng(seed)
    tree = [(int(rng.integers(0, i)), i) for i in range(1, count)]
    more = np.sort(rng.integers(0, count, (extra, 2)), 1)
    edges = np.array(sorted({*tree, *[tuple(e) for e in more.tolist() if e[0] != e[1]]}), np.int32)
    bridges, cuts, hanging = find_weak_edges(count, edges)
    expected_bridges, expected_cuts = brute_weak(count, edges)
    assert bridges.tolist() == expected_bridges
    assert cuts.tolist() == expected_cuts
    assert hanging[bridges].all()
    assert count == 2 or cuts[edges[hanging]].any(1).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 12), st.integers(0, 10), st.integers(0, 2**32 - 1))
def test_joints_are_the_minimum_spanning_tree_of_components(count, given_edges, seed):
    rng = np.random.default_rng(seed)
    edges = np.sort(rng.integers(0, count, (given_edges, 2)), 1).astype(np.int32)
    points = rng.random((count, 3))
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    added = find_joining_edges(count, edges, apart)
    label = label_components(count, edges)
    assert len(added) == label.max()
    assert label_components(count, np.concatenate([edges, added])).max() == 0
    # Kruskal over all pairs gives the least sum.
    total, forest = 0.0, label.copy()
    pairs = np.argwhere(np.tri(count, k=-1))
    for i, j in pairs[np.argsort(apart[pairs[:, 0], pairs[:, 1]])]:
        if forest[i] != forest[j]:
            total += apart[i, j]
            forest[forest == forest[j]] = forest[i]
    assert apart[added[:, 0], added[:, 1]].sum() == pytest.approx(total)
