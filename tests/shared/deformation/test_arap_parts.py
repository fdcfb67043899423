"""Tests of the kernels of surface deformation against plain linear algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from tolerances import SOLVER_TOLERANCE, are_alike

from enliven.deformation.arap.factor import factorise
from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.polar import ROWS, TRACE, N, R, polar
from enliven.deformation.arap.solver import ArapSolver
from enliven.deformation.arap.solves import solve_backward, solve_for_unit_vector, solve_forward
from enliven.deformation.arap.threads import ThreadChoice
from enliven.deformation.arap.weights import MIN_EDGE_WEIGHT, find_virtual_edges, surface_edges
from enliven.deformation.graph.connectivity import label_components
from enliven.document.surface_settings import ArapSettings
from enliven.meshes.mesh import Mesh
from enliven.rotation import nearest_rotation


def blocks_of(matrices):
    block = np.zeros(ROWS * N)
    block[: 9 * N] = matrices.transpose(2, 1, 0).reshape(-1)
    return block


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["any", "flat", "mirrored", "line", "zero", "tiny", "huge"]))
def test_polar_finds_the_nearest_rotation(seed, kind):
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(N, 3, 3))
    u, s, vt = np.linalg.svd(matrices)
    s *= {"flat": [1, 1, 0], "line": [1, 0, 0], "zero": [0, 0, 0]}.get(kind, [1, 1, 1])
    matrices = (u * s[:, None]) @ vt * {"mirrored": -1, "tiny": 1e-60, "huge": 1e60}.get(kind, 1)
    block, frames = blocks_of(matrices), np.zeros(16 * N)
    polar(block, N, frames, 0)
    turns = block[R * N : (R + 9) * N].reshape(3, 3, N).transpose(2, 1, 0)
    assert np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.linalg.det(turns).min() > 0.99
    best = np.einsum("nij,nij->n", nearest_rotation(matrices), matrices)
    scale = np.linalg.norm(matrices, axis=(1, 2)) + 1e-300
    assert np.abs((np.einsum("nij,nij->n", turns, matrices) - best) / scale).max() < 1e-9
    assert np.abs((block[TRACE * N : (TRACE + 1) * N] - best) / scale).max() < 1e-9


def random_sheet(count, seed):
    points = np.random.default_rng(seed).random((count, 2))
    faces = Delaunay(points).simplices.astype(np.int32)
    return np.column_stack([points, np.zeros(count)]), faces


@pytest.mark.parametrize("count", [3, 4, 9, 60, 700])
def test_the_factor_solves_as_a_dense_matrix_does(count):
    points, faces = random_sheet(count, count)
    edges, weights = surface_edges(points, faces)
    dense = np.zeros((count, count))
    dense[edges[:, 0], edges[:, 1]] = dense[edges[:, 1], edges[:, 0]] = -weights
    dense -= np.diag(dense.sum(1))
    dense[0, 0] += np.diag(dense).mean()
    factor = factorise(count, edges, weights)
    right = np.random.default_rng(1).normal(size=(count, 3))
    z = np.zeros((count + 4, 4), np.float32)
    z[:count, :3] = right[factor.order]
    room = np.zeros(4 * (factor.tallest + 4), np.float32)
    solve_forward(factor, z.reshape(-1), room)
    half = z[:count, :3].copy()
    solve_backward(factor, z.reshape(-1), room)
    solution = np.empty((count, 3))
    solution[factor.order] = z[:count, :3]
    exact = np.linalg.solve(dense, right)
    assert np.abs(solution - exact).max() < 2e-5 * np.abs(exact).max()
    assert np.all(z[count:] == 0)
    place = count // 2
    rows, column = solve_for_unit_vector(factor, place)
    unit = np.zeros(count)
    unit[place] = 1
    z[:] = 0
    z[:count, 0] = unit
    solve_forward(factor, z.reshape(-1), room)
    sparse = np.zeros(count)
    sparse[rows] = column
    assert np.abs(sparse - z[:count, 0]).max() < 1e-5 * np.abs(column).max()
    assert np.isfinite(half).all()


def test_weights_are_cotangents_and_never_below_the_least():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    edges, weights = surface_edges(square, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    weight_of_edge = {tuple(e): w for e, w in zip(edges.tolist(), weights, strict=True)}
    assert weight_of_edge[(0, 1)] == pytest.approx(0.5) and weight_of_edge[(0, 2)] == MIN_EDGE_WEIGHT
    points, faces = random_sheet(400, 0)
    points[:, 1] *= 1e-3
    _, thin = surface_edges(points, faces)
    assert thin.min() >= MIN_EDGE_WEIGHT and thin.max() < 60


@pytest.mark.parametrize("shells", [2, 5, 90])
def test_virtual_edges_make_one_piece_of_many(shells):
    rng = np.random.default_rng(shells)
    points = (rng.normal(0, 5, (shells, 1, 3)) + rng.normal(0, 0.2, (shells, 4, 3))).reshape(-1, 3)
    faces = np.concatenate([[[k, k + 1, k + 2], [k, k + 2, k + 3]] for k in range(0, 4 * shells, 4)])
    edges, _ = surface_edges(points, faces.astype(np.int32))
    links, _ = find_virtual_edges(points, edges)
    assert label_components(len(points), edges).max() + 1 == shells
    assert label_components(len(points), np.concatenate([edges, links])).max() == 0
    if shells == 2:
        apart = np.linalg.norm(points[:4, None] - points[4:], axis=2)
        ends = np.linalg.norm(points[links[:, 0]] - points[links[:, 1]], axis=1)
        assert ends.min() == pytest.approx(apart.min())


def test_recently_faster_method_is_used_and_the_other_is_retried():
    pace, taken = ThreadChoice(), []
    for seconds in [{1: 4.0, 2: 3.0}] * 100 + [{1: 4.0, 2: 9.0}] * 200:
        taken.append(pace.choose_thread_count())
        pace.record_duration(taken[-1], seconds[taken[-1]])
    assert taken[:2] == [1, 2]
    assert 1 <= taken[2:100].count(1) <= 5
    assert taken[200:].count(2) <= 5
    assert 2 in taken[200:]


def test_two_threads_give_equal_results():
    points, faces = random_sheet(5000, 2)
    solutions = []
    for threads in (0, 1, 2):
        solver = ArapSolver(Mesh(points, faces), ArapSettings(threads=threads))
        solver.set_handles([Handle("a", (0,)), Handle("b", (1,)), Handle("c", (2,))])
        solver.solve({"a": points[0] + [0.1, 0.2, 0.3]})
        solutions.append(solver.solve({"b": points[1] + [0.0, 0.1, 0.3]}))
    assert all(are_alike(solution, solutions[0], SOLVER_TOLERANCE) for solution in solutions)
