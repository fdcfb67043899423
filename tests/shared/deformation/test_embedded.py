"""The embedded deformation against a slow Gauss-Newton with a dense Jacobian, and its laws."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from enliven import rotation
from enliven.deformation.connectivity import weak_edges
from enliven.deformation.descent import descend
from enliven.deformation.embedded import EmbeddedSettings, EmbeddedSolver
from enliven.deformation.energy import along_line, best_step, gradient
from enliven.deformation.graph import DeformationGraph
from enliven.errors import InputError

EXACT = EmbeddedSettings(iterations=3000, tolerance=1e-14)
NAMES = ("rotation", "smoothness", "constraint", "rigidity")


@dataclass
class Points:
    points: np.ndarray
    node_indices: np.ndarray
    node_weights: np.ndarray


def make_graph(count, seed, tail=False):
    """Random nodes, each linked with its four nearest; with ``tail`` two more hang on by one edge each."""
    rng = np.random.default_rng(seed)
    positions = rng.random((count, 3)) * [0.5, 1.5, 0.5]
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    nearest = np.argsort(apart, 1)[:, 1:5]
    pairs = {tuple(sorted((i, int(j)))) for i in range(count) for j in nearest[i]}
    # A ladder along the height makes it one piece without cut vertices.
    order = np.argsort(positions[:, 1])
    for gap in (1, 2):
        pairs |= {tuple(sorted(p)) for p in zip(order[:-gap].tolist(), order[gap:].tolist(), strict=True)}
    if tail:
        positions = np.concatenate([positions, [[0.25, 1.7, 0.25], [0.25, 1.9, 0.25]]])
        pairs |= {(int(order[-1]), count), (count, count + 1)}
        count += 2
    edges = np.array(sorted(pairs), np.int32)
    bridges, cuts, hanging = weak_edges(count, edges)
    normals = np.tile([0.0, 0, 1], (count, 1))
    return DeformationGraph(positions, normals, np.zeros(count, np.int32), edges, hanging, bridges, cuts, 0.1)


def make_points(graph, count, seed):
    rng = np.random.default_rng(seed + 100)
    indices = [rng.choice(len(graph.positions), 4, replace=False) for _ in range(count)]
    indices = np.array(indices, np.int32).reshape(-1, 4)
    weights = rng.random((count, 4))
    weights /= weights.sum(1, keepdims=True)
    points = (graph.positions[indices] * weights[..., None]).sum(1) + 0.02 * rng.normal(size=(count, 3))
    return Points(points, indices, weights)


def residuals(flat, graph, points, targets, pulls, settings):
    """Every residual of eq. 3-8, weighted, as the paper prints them; flat holds R (N, 9) and t (N, 3)."""
    count = len(graph.positions)
    r, t = flat[: 9 * count].reshape(-1, 3, 3), flat[9 * count :].reshape(-1, 3)
    g, eye = graph.positions, np.eye(3)

    def moved(j, v):
        return np.einsum("nab,nb->na", r[j], v - g[j]) + g[j] + t[j]

    def beyond(m):
        return (m - eye).ravel()

    j, k = graph.edges.T
    rj, rk = graph.edges[graph.rigid].T
    middle = (g[rj] + g[rk]) / 2
    turning = settings.rigid_translation == "turning"
    slip = moved(rj, middle) - moved(rk, middle) if turning else t[rk] - t[rj]
    phi = sum(
        points.node_weights[:, m, None] * moved(points.node_indices[:, m], points.points) for m in range(4)
    )
    terms = {
        "rotation": [beyond(np.swapaxes(r, 1, 2) @ r)],
        "smoothness": [(moved(j, g[k]) - moved(k, g[k])).ravel(), (moved(k, g[j]) - moved(j, g[j])).ravel()],
        "constraint": [(np.sqrt(pulls)[:, None] * (phi - targets)).ravel()],
        "rigidity": [beyond(np.swapaxes(r[rk], 1, 2) @ r[rj]), slip.ravel()],
    }
    return np.concatenate([np.sqrt(getattr(settings, name)) * np.concatenate(terms[name]) for name in NAMES])


def reference_minimum(graph, points, targets, pulls, settings, start):
    """Damped Gauss-Newton with a dense Jacobian by central differences, to the end."""
    linear, positions = start
    x = np.concatenate([linear.ravel(), (positions - graph.positions).ravel()])

    def f(x):
        return residuals(x, graph, points, targets, pulls, settings)

    damping, value = 1e-6, f(x)
    for _ in range(100):
        # The residuals are at most quadratic, so central differences are exact.
        jacobian = np.stack([(f(x + h) - f(x - h)) / 2e-3 for h in 1e-3 * np.eye(len(x))], 1)
        while True:
            normal = jacobian.T @ jacobian + damping * np.eye(len(x))
            step = np.linalg.solve(normal, -jacobian.T @ value)
            trial = f(x + step)
            if trial @ trial <= value @ value or damping > 1e6:
                break
            damping *= 10
        gained = value @ value - trial @ trial
        x, value, damping = x + step, trial, damping / 10
        if gained <= 1e-10 * (value @ value):
            break
    return float(value @ value)


def random_state(graph, seed, size=0.2):
    rng = np.random.default_rng(seed)
    count = len(graph.positions)
    return np.eye(3) + size * rng.normal(size=(count, 3, 3)), graph.positions + size * rng.normal(
        size=(count, 3)
    )


CASES = [(False, "printed"), (True, "printed"), (True, "turning")]


@pytest.mark.parametrize(("tail", "translation"), CASES)
def test_the_energy_is_the_papers(tail, translation):
    graph = make_graph(12, 1, tail)
    points = make_points(graph, 9, 1)
    chosen = EmbeddedSettings(1.3, 8.0, 90.0, 0.7, rigid_translation=translation, iterations=1, tolerance=1e9)
    rng = np.random.default_rng(0)
    targets, pulls = rng.normal(size=(9, 3)), rng.random(9)
    linear, positions = random_state(graph, 5)
    solver = EmbeddedSolver(graph, points, chosen, start=(linear, positions))
    solver._take(targets, pulls)
    solver._report()
    flat = np.concatenate([linear.ravel(), (positions - graph.positions).ravel()])
    slow = residuals(flat, graph, points, targets, pulls, chosen)
    assert solver.energy["total"] == pytest.approx(slow @ slow)
    if tail:
        assert solver.energy["rigidity"] > 0


@pytest.mark.parametrize(("tail", "translation"), CASES)
def test_the_gradient_and_the_line_are_those_of_the_energy(tail, translation):
    graph = make_graph(8, 2, tail)
    points = make_points(graph, 6, 2)
    solver = EmbeddedSolver(
        graph, points, EmbeddedSettings(rigid_translation=translation), random_state(graph, 3)
    )
    rng = np.random.default_rng(0)
    solver._take(rng.normal(size=(6, 3)), rng.random(6))
    x, room = solver._x, np.empty_like(solver._x)

    def energy(flat):
        return gradient(flat.reshape(x.shape), solver._terms, np.empty_like(x))[4]

    gradient(x, solver._terms, room)
    np.testing.assert_allclose(room.ravel(), approx_fprime(x.ravel(), energy, 1e-7), rtol=2e-4, atol=2e-3)
    way = rng.normal(size=x.shape)
    c = along_line(x, way, solver._terms)
    for s in (0.0, 0.3, -1.2, 2.0):
        assert np.polyval(c[::-1], s) == pytest.approx(energy((x + s * way).ravel()))


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_the_step_is_a_minimum_below_the_start(seed):
    rng = np.random.default_rng(seed)
    # A sum of squares of quadratics, as every energy along a line is.
    a, b, d = rng.normal(size=(3, 6)) * 10.0 ** rng.integers(-3, 4)
    c = np.array([a @ a, 2 * a @ b, b @ b + 2 * a @ d, 2 * b @ d, d @ d])
    if c[1] > 0:
        c[1::2] *= -1
    s = best_step(c)
    assert s > 0
    assert np.polyval(c[::-1], s) < c[0]
    slope = np.polyval(np.polyder(c[::-1]), s)
    assert abs(slope) <= 1e-3 * abs(c[1])


@pytest.mark.parametrize(("tail", "translation"), CASES)
@pytest.mark.parametrize("seed", [1, 2])
def test_it_finds_the_minimum_of_the_reference(tail, translation, seed):
    graph = make_graph(10, seed, tail)
    points = make_points(graph, 8, seed)
    chosen = replace(EXACT, rigid_translation=translation)
    rng = np.random.default_rng(seed)
    targets = points.points + 0.15 * rng.normal(size=points.points.shape)
    pulls = 0.2 + 0.8 * rng.random(8)
    solver = EmbeddedSolver(graph, points, chosen)
    solver.solve(targets, pulls)
    expected = reference_minimum(graph, points, targets, pulls, chosen, solver.state())
    assert solver.energy["total"] == pytest.approx(expected, rel=1e-4)
    start = EmbeddedSolver(graph, points, chosen).state()
    assert solver.energy["total"] <= 1.002 * reference_minimum(graph, points, targets, pulls, chosen, start)


def test_a_frame_of_a_smooth_motion_is_within_two_thousandths():
    graph = make_graph(40, 7, tail=True)
    points = make_points(graph, 40, 7)
    quick = EmbeddedSolver(graph, points)
    gaps = []
    for frame in range(60):
        bend = 0.4 * np.sin(2 * np.pi * frame / 60)
        turn = rotation.from_rotation_vector(np.outer(points.points[:, 1] * bend, [1.0, 0, 0.3]))
        targets = rotation.rotate(turn, points.points) + np.array([0, 0, 0.02 * frame])
        quick.solve(targets)
        thorough = EmbeddedSolver(graph, points, EXACT, quick.state())
        thorough.solve(targets)
        gaps.append(quick.energy["total"] / max(thorough.energy["total"], 1e-6) - 1)
    assert max(gaps[1:]) < 0.002


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_rigid_motion_of_all_targets_moves_all_nodes_rigidly(seed, tail):
    graph = make_graph(12, seed % 50, tail)
    points = make_points(graph, 10, seed % 50)
    rng = np.random.default_rng(seed)
    turn = rotation.from_rotation_vector(rng.normal(size=3))
    shift = rng.normal(size=3) * 3
    # As printed, eq. 7 resists turning; without a loose part there is no eq. 7.
    solver = EmbeddedSolver(graph, points, replace(EXACT, rigid_translation="turning" if tail else "printed"))
    linear, positions = solver.solve(rotation.rotate(turn, points.points) + shift)
    assert solver.energy["total"] < 1e-6
    np.testing.assert_allclose(linear, np.broadcast_to(rotation.to_matrix(turn), linear.shape), atol=2e-3)
    np.testing.assert_allclose(positions, rotation.rotate(turn, graph.positions) + shift, atol=2e-3)


def test_a_shift_leaves_no_energy_as_printed_either():
    graph = make_graph(12, 3, tail=True)
    points = make_points(graph, 10, 3)
    solver = EmbeddedSolver(graph, points)
    solver.solve(points.points + np.array([1.0, 2.0, 3.0]))
    assert solver.energy["total"] < 1e-9


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 2.0))
def test_the_energy_never_rises(seed, size):
    graph = make_graph(12, seed % 20, tail=True)
    points = make_points(graph, 10, seed % 20)
    rng = np.random.default_rng(seed)
    targets = points.points + size * rng.normal(size=points.points.shape)
    solver = EmbeddedSolver(graph, points, start=random_state(graph, seed))
    solver.solve(targets)
    x = np.ascontiguousarray(solver._x + 0.3 * rng.normal(size=solver._x.shape))
    pattern, room = solver._pattern, np.empty_like(x)
    before = gradient(x, solver._terms, room)[4]
    for _ in range(30):
        descend(x, solver._terms, pattern.start, pattern.row, solver._blocks, solver._memory, 1, 0.0)
        after = gradient(x, solver._terms, room)[4]
        assert after <= before * (1 + 1e-12) + 1e-12
        before = after


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_no_node_comes_out_mirrored(seed, size):
    graph = make_graph(12, seed % 20, tail=True)
    points = make_points(graph, 10, seed % 20)
    rng = np.random.default_rng(seed)
    solver = EmbeddedSolver(graph, points, start=random_state(graph, seed, 1.0))
    for _ in range(4):
        linear, _ = solver.solve(points.points + size * rng.normal(size=points.points.shape))
        assert np.linalg.det(linear).min() > 0.04


def test_a_spoilt_state_is_left_in_one_frame():
    graph = make_graph(30, 8)
    points = make_points(graph, 30, 8)
    mirrored = np.tile(np.diag([1.0, 1.0, -1.0]), (30, 1, 1)), graph.positions * [1, 1, -1] + 5
    solver = EmbeddedSolver(graph, points, start=mirrored)
    linear, positions = solver.solve(points.points)
    np.testing.assert_allclose(linear, np.broadcast_to(np.eye(3), linear.shape), atol=1e-3)
    np.testing.assert_allclose(positions, graph.positions, atol=1e-3)


def test_lost_targets_are_left_out():
    graph = make_graph(12, 4)
    points = make_points(graph, 10, 4)
    targets = points.points + 0.1
    lost = np.array([2, 5, 6])
    with_nan, without = targets.copy(), np.ones(10)
    with_nan[lost[0]], with_nan[lost[1], 1], with_nan[lost[2]] = np.nan, np.inf, 1e30
    without[lost] = 0.0
    a, b = EmbeddedSolver(graph, points, EXACT), EmbeddedSolver(graph, points, EXACT)
    np.testing.assert_allclose(a.solve(with_nan)[1], b.solve(targets, without)[1], atol=1e-12)
    weights = np.where(np.isin(np.arange(10), lost), np.nan, 1.0)
    np.testing.assert_allclose(EmbeddedSolver(graph, points, EXACT).solve(targets, weights)[1], b.state()[1])


def test_wild_targets_never_break_it_and_it_recovers():
    graph = make_graph(30, 8, tail=True)
    points = make_points(graph, 30, 8)
    rng = np.random.default_rng(0)
    solver = EmbeddedSolver(graph, points)
    for frame in range(120):
        targets = points.points + rng.normal(size=(30, 3)) * rng.choice([0.1, 1.0, 30.0])
        targets[rng.random(30) < 0.2] = np.nan
        weights = rng.random(30) * (frame % 7 > 0)
        linear, positions = solver.solve(targets, weights)
        assert np.isfinite(linear).all() and np.isfinite(positions).all()
    for _ in range(60):
        linear, positions = solver.solve(points.points)
    assert solver.energy["total"] < 1e-3
    np.testing.assert_allclose(positions, graph.positions, atol=0.02)
    assert np.linalg.det(linear).min() > 0.5


@pytest.mark.parametrize("pulled", ["nothing", "no weight"])
def test_without_constraints_it_stays_where_it_was(pulled):
    graph = make_graph(12, 5)
    points = make_points(graph, 10 if pulled == "no weight" else 0, 5)
    turn = rotation.to_matrix(rotation.from_rotation_vector([0.0, 1.0, 0.0]))
    start = np.broadcast_to(turn, (12, 3, 3)), graph.positions @ turn.T + [1.0, 0, 0]
    solver = EmbeddedSolver(graph, points, start=start)
    linear, positions = solver.solve(points.points + 1, np.zeros(len(points.points)))
    np.testing.assert_allclose(linear, start[0], atol=1e-12)
    np.testing.assert_allclose(positions, start[1], atol=1e-12)
    solver.reset()
    np.testing.assert_allclose(solver.state()[0], np.broadcast_to(np.eye(3), (12, 3, 3)))


def test_a_single_point_turns_nothing():
    graph = make_graph(12, 6)
    points = make_points(graph, 1, 6)
    linear, positions = EmbeddedSolver(graph, points).solve(points.points + np.array([0.3, 0, 0]))
    np.testing.assert_allclose(linear, np.broadcast_to(np.eye(3), (12, 3, 3)), atol=1e-4)
    np.testing.assert_allclose(positions, graph.positions + np.array([0.3, 0, 0]), atol=1e-4)


def test_a_graph_of_one_node():
    graph = replace(make_graph(12, 6), positions=np.zeros((1, 3)), edges=np.empty((0, 2), np.int32))
    graph = replace(graph, rigid=np.empty(0, bool), bridges=np.empty(0, bool), cut_vertices=np.zeros(1, bool))
    points = Points(np.eye(3), np.zeros((3, 4), np.int32), np.tile([1.0, 0, 0, 0], (3, 1)))
    turn = rotation.to_matrix(rotation.from_rotation_vector([0.5, -1.0, 0.2]))
    linear, positions = EmbeddedSolver(graph, points, EXACT).solve(np.eye(3) @ turn.T + 2)
    np.testing.assert_allclose(linear[0], turn, atol=1e-4)
    np.testing.assert_allclose(positions[0], 2, atol=1e-4)


def test_the_wrong_number_of_targets_is_refused():
    graph = make_graph(12, 6)
    points = make_points(graph, 3, 6)
    with pytest.raises(InputError, match="constraints"):
        EmbeddedSolver(graph, points).solve(np.zeros((4, 3)))
    with pytest.raises(InputError, match="constraints"):
        EmbeddedSolver(graph, points).solve(np.zeros((3, 3)), np.ones(2))
