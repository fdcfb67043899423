"""Tests of squash-and-stretch deformation against a slow dense reference, of its invariants, and of its
errors.
"""

from dataclasses import replace

import numpy as np
import pytest
from arap_energy import total_energy
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import SOLVER_TOLERANCE, are_alike

from enliven import rotation
from enliven.deformation.arap.input import Handle
from enliven.deformation.arap.solver import ArapSolver
from enliven.deformation.arap.surface import prepare_surface
from enliven.deformation.arap.weights import find_virtual_edges, surface_edges
from enliven.document.surface_settings import ArapSettings
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh, weld

PLAIN = ArapSettings(squash_and_stretch=False)


def sphere(rings=7, around=10, radius=0.5, centre=(0.0, 0.0, 0.0)):
    """Returns a closed sphere with a vertex at each pole."""
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(turn),
            np.cos(polar)[:, None] * np.ones(around),
            np.sin(polar)[:, None] * np.sin(turn),
        ],
        -1,
    ).reshape(-1, 3)
    faces = []
    last = len(ring)
    for k in range(around):
        n = (k + 1) % around
        faces += [[last, n, k], [last + 1, last - around + k, last - around + n]]
        for r in range(rings - 2):
            a, b, c, d = r * around + k, r * around + n, (r + 1) * around + k, (r + 1) * around + n
            faces += [[a, b, d], [a, d, c]]
    points = np.concatenate([ring, [[0, 1.0, 0], [0, -1.0, 0]]]) * radius + np.asarray(centre)
    return Mesh(points, np.array(faces, np.int32), "ball")


def sheet(across=9, along=5, jitter=0.0, seed=0):
    """Returns an open flat grid whose points are randomly displaced in the plane and out of it."""
    x, y = np.meshgrid(np.linspace(0, 1, across), np.linspace(0, 0.5, along))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1)
    points += np.random.default_rng(seed).normal(0, jitter, points.shape)
    faces = []
    for r in range(along - 1):
        for c in range(across - 1):
            a = r * across + c
            faces += [[a, a + 1, a + across + 1], [a, a + across + 1, a + across]]
    return Mesh(points, np.array(faces, np.int32), "sheet")


def volume(mesh, vertices):
    a, b, c = (vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


class Twin:
    """A literal implementation of section 4: dense matrices, one SVD and one eigenvalue problem per cell."""

    def __init__(self, mesh, held, settings):
        self.rest, self.settings, self.held = mesh.vertices, settings, held
        edges, weights = surface_edges(mesh.vertices, mesh.faces)
        links, more = find_virtual_edges(mesh.vertices, edges)
        count = len(mesh.vertices)
        self.w = np.zeros((count, count))
        for (i, j), w in zip(np.concatenate([edges, links]), np.concatenate([weights, more]), strict=True):
            self.w[i, j] = self.w[j, i] = w
        self.x = mesh.vertices.copy()

    def rotation(self, i, x):
        rest, new = self.rest[i] - self.rest, x[i] - x
        u, _, vt = np.linalg.svd((self.w[i][:, None] * rest).T @ new)
        turn = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
        return turn, rest @ turn.T, new

    def shape_frames(self, x):
        frames = []
        for i in range(len(x)):
            turn, rest, new = self.rotation(i, x)
            most = self.settings.most_stretch if self.settings.squash_and_stretch else 1.0
            s = (self.w[i][:, None] * new * rest).sum() / (self.w[i][:, None] * rest * rest).sum()
            s = (s + self.settings.hold) / (1 + self.settings.hold)
            frames.append(np.clip(s, 1 / most, most) * turn)
        return frames

    def pose_frames(self, x):
        frames = []
        for i in range(len(x)):
            turn, rest, new = self.rotation(i, x)
            w = self.w[i][:, None]
            left = new - rest
            power = np.linalg.matrix_power((w * left).T @ left / max((w * left * left).sum(), 1e-300), 32)
            axis = power / np.trace(power)
            steady = 0.02 * (w * rest * rest).sum()
            s = (np.trace(axis @ (w * new).T @ rest) + steady) / (
                np.trace(axis @ (w * rest).T @ rest) + steady
            )
            s = (s - 1) * self.settings.exaggeration + 1
            s = np.clip(s, 1 / self.settings.most_stretch, self.settings.most_stretch)
            across = np.sqrt(1 / s)
            frames.append((across * np.eye(3) + (s - across) * axis) @ turn)
        return frames

    def settle(self, frames, wanted, soft):
        """Solves eq. 9 or 13 for the positions. Handles are hard or soft constraints."""
        count = len(self.rest)
        laplacian = np.diag(self.w.sum(1)) - self.w
        right = np.zeros((count, 3))
        for i in range(count):
            for j in np.flatnonzero(self.w[i]):
                right[i] += self.w[i, j] * (frames[i] + frames[j]) / 2 @ (self.rest[i] - self.rest[j])
        for vertex, target, weight in zip(self.held, wanted, soft, strict=True):
            if weight is not None:
                laplacian[vertex, vertex] += weight / 2
                right[vertex] += weight / 2 * target
        for vertex, target, weight in zip(self.held, wanted, soft, strict=True):
            if weight is None:
                laplacian[vertex] = np.eye(count)[vertex]
                right[vertex] = target
        return np.linalg.solve(laplacian, right)

    def frame(self, wanted, soft):
        shaping = self.settings.iterations - self.settings.squash_and_stretch
        for _ in range(shaping):
            self.x = self.settle(self.shape_frames(self.x), wanted, soft)
        if not self.settings.squash_and_stretch:
            return self.x
        return self.settle(self.pose_frames(self.x), wanted, soft)


@pytest.mark.parametrize("plain", [True, False])
@pytest.mark.parametrize("mesh", [sphere(), sheet(jitter=0.01)], ids=["ball", "sheet"])
def test_frames_match_the_dense_reference(mesh, plain):
    kind = ArapSettings(
        squash_and_stretch=not plain, follow=0.0, exaggeration=1.3, hold=0.0 if plain else 0.5, volume=0.0
    )
    handles, soft = [0, 17, 30, 40], [None, 3.0, None, None]
    solver, twin = ArapSolver(mesh, kind), Twin(mesh, handles, kind)
    solver.set_handles([Handle(str(v), (v,), w) for v, w in zip(handles, soft, strict=True)])
    rng = np.random.default_rng(3)
    for _ in range(4):
        wanted = mesh.vertices[handles] + rng.normal(0, 0.15, (4, 3))
        twin.x = solver.get_surface()
        solved = solver.solve({str(v): wanted[k] for k, v in enumerate(handles)})
        assert np.abs(solved - twin.frame(wanted, soft)).max() < 1e-5
        assert np.array_equal(solved[[0, 30, 40]], wanted[[0, 2, 3]])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.booleans(), st.floats(0.01, 1.0))
def test_energy_never_rises_in_the_shape_state(seed, plain, far):
    rng = np.random.default_rng(seed)
    mesh = sheet(jitter=0.02, seed=seed) if seed % 2 else sphere()
    kind = ArapSettings(iterations=1 if plain else 2, squash_and_stretch=not plain, hold=seed % 3)
    solver, surface = ArapSolver(mesh, kind), prepare_surface(mesh, kind.most_vertices)
    chosen = rng.choice(len(mesh.vertices), 5, replace=False).tolist()
    solver.set_handles([Handle(str(v), (v,), None if v % 2 else 2.0) for v in chosen])
    solver.solve({str(v): mesh.vertices[v] + rng.normal(0, far, 3) for v in chosen})
    before = total_energy(solver, surface)
    for _ in range(12):
        solver.solve()
        after = total_energy(solver, surface)
        assert after <= before * (1 + 1e-9) + 1e-12
        before = after


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 8), st.booleans())
def test_rigid_motion_of_the_handles_is_the_meshs(seed, count, plain):
    rng = np.random.default_rng(seed)
    mesh = sphere(centre=rng.normal(0, 3, 3))
    solver = ArapSolver(mesh, PLAIN if plain else None)
    chosen = rng.choice(len(mesh.vertices), count, replace=False)
    solver.set_handles([Handle(str(v), (int(v),)) for v in chosen])
    turn = rotation.to_matrix(rotation.normalized(rng.normal(size=4)))
    moved = mesh.vertices @ turn.T + rng.normal(0, 2, 3)
    solved = solver.solve({str(v): moved[v] for v in chosen})
    assert np.abs(solved - moved).max() < 1e-9
    assert total_energy(solver, prepare_surface(mesh, solver.settings.most_vertices)) < 1e-18


@pytest.mark.slow
def test_small_changes_stay_small_where_the_whole_is_about_to_follow():
    mesh = sphere()
    handles = [60, 61, 0, 25]
    rng = np.random.default_rng(5)
    bend = rng.normal(0, 1, (4, 3))
    turn = rotation.to_matrix(rotation.from_rotation_vector(np.array([0.5, 0.2, 0.0])))
    carried = mesh.vertices[handles] @ turn.T
    frames = []
    for by in np.linspace(0.0, 0.2, 400):
        solver = ArapSolver(mesh)
        solver.set_handles([Handle(str(v), (v,)) for v in handles])
        frames.append(solver.solve({str(v): carried[k] + by * bend[k] for k, v in enumerate(handles)}))
    steps = np.abs(np.diff(frames, axis=0)).max((1, 2))
    assert steps.max() < 60 * np.median(steps)


def test_at_rest_nothing_moves():
    mesh = sphere(centre=(100.0, 0.0, 0.0))
    solver = ArapSolver(mesh)
    solver.set_handles([Handle("pole", (60,))])
    assert np.abs(solver.solve() - mesh.vertices).max() < 1e-12


@pytest.mark.parametrize("by", [-0.18, 0.18])
@pytest.mark.parametrize("tall", [1.0, 1.7])
def test_a_figure_pressed_or_drawn_keeps_more_of_its_volume_than_plain_arap(by, tall):
    ball = sphere(14, 24)
    mesh = Mesh(ball.vertices * [1.0, tall, 1.0], ball.faces)
    ends = [np.flatnonzero(side * mesh.vertices[:, 1] > 0.47 * tall).tolist() for side in (1, -1)]
    rest, drift = volume(mesh, mesh.vertices), {}
    for name, kind in (("plain", PLAIN), ("squash", ArapSettings()), ("none", ArapSettings(volume=0.0))):
        solver = ArapSolver(mesh, kind)
        solver.set_handles([Handle(str(k), tuple(end)) for k, end in enumerate(ends)])
        for frame in range(40):
            shift = np.array([0.0, by * tall * min(1.0, frame / 20), 0.0])
            solved = solver.solve(
                {str(k): mesh.vertices[end] + (1 - 2 * k) * shift for k, end in enumerate(ends)}
            )
        drift[name] = abs(volume(mesh, solved) / rest - 1)
    assert drift["squash"] < 0.02
    assert drift["squash"] < 0.5 * drift["plain"] and drift["squash"] < 0.5 * drift["none"]


def test_added_and_removed_handles_leave_no_change():
    mesh = sphere()
    first, second = ArapSolver(mesh, PLAIN), ArapSolver(mesh, PLAIN)
    for solver in (first, second):
        solver.set_handles([Handle("a", (0,)), Handle("b", (33,))])
    first.set_handles([*first.handles.values(), Handle("c", (20,))])
    first.set_handles([Handle("a", (0,)), Handle("b", (33,))])
    target = {"a": mesh.vertices[0] + [0.1, 0.2, 0.0]}
    assert are_alike(first.solve(target), second.solve(target), SOLVER_TOLERANCE)


def test_shells_soups_and_loose_vertices_move_together():
    ball, far = sphere(), sphere(radius=0.2, centre=(0.0, 0.9, 0.0))
    soup = Mesh(ball.vertices[ball.faces].reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3))
    both = Mesh(
        np.concatenate([soup.vertices, far.vertices, [[2.0, 0.0, 0.0]]]),
        np.concatenate([soup.faces, far.faces + len(soup.vertices)]),
        "two",
    )
    solver = ArapSolver(both)
    notes = " ".join(solver.notes)
    assert "vertices were joined with another vertex at the same position" in notes
    assert "virtual edges" in notes and "no face" in notes
    top = len(soup.vertices)
    solver.set_handles([Handle("low", tuple(range(0, 60, 7))), Handle("high", (top,))])
    turned = both.vertices[top] + [0.15, 0.0, 0.0]
    for _ in range(30):
        solved = solver.solve({"high": turned})
    assert np.isfinite(solved).all()
    # The small ball has moved and is still a ball.
    small = solved[top : top + len(far.vertices)]
    assert np.linalg.norm(small.mean(0) - far.vertices.mean(0)) > 0.05
    distances = np.linalg.norm(small - small.mean(0), axis=1)
    assert distances.min() > 0.12 and distances.max() < 0.3
    # Welded vertices stay together.
    _, of = weld(both)
    first = np.unique(of, return_index=True)[1][of]
    assert np.array_equal(solved, solved[first])


def test_degenerate_faces_are_tolerated():
    mesh = sheet()
    thin = mesh.vertices.copy()
    thin[10] = thin[11] + [1e-9, 0, 0]
    thin[20] = (thin[21] + thin[22]) / 2
    faces = np.concatenate([mesh.faces, [[5, 6, 6], [7, 8, 7]]]).astype(np.int32)
    solver = ArapSolver(Mesh(thin, faces))
    solver.set_handles([Handle("a", (0,)), Handle("b", (44,))])
    solved = solver.solve({"b": thin[44] + [0.1, 0.1, 0.3]})
    assert np.isfinite(solved).all() and np.abs(solved).max() < 3


def add(solver, handle):
    solver.set_handles([*solver.handles.values(), handle])


@pytest.mark.parametrize(
    "does, says",
    [
        (lambda s: s.solve({"a": [[np.nan, 0, 0]]}), "'a'"),
        (lambda s: s.solve({"a": [[1e9, 0, 0]]}), "units"),
        (lambda s: s.solve({"a": np.zeros((2, 3))}), "1 vertices"),
        (lambda s: s.solve({"z": np.zeros(3)}), "Known handles: a, b"),
        (lambda s: add(s, Handle("c", (62,))), "belongs to no face"),
        (lambda s: add(s, Handle("c", (99,))), "vertex 99 does not exist"),
        (lambda s: add(s, Handle("c", ())), "no vertex"),
        (lambda s: add(s, Handle("a", (5,))), "the same name"),
        (lambda s: add(s, Handle("c", (5,), -1.0)), "weight"),
        (lambda s: (add(s, Handle("twin", (0,))), s.solve({"twin": [[3.0, 0, 0]]})), "'twin'"),
    ],
)
def test_bad_input_is_reported_and_last_good_pose_stays(does, says):
    ball = sphere()
    mesh = Mesh(np.concatenate([ball.vertices, [[0.0, 3.0, 0.0]]]), ball.faces)
    solver = ArapSolver(mesh)
    solver.set_handles([Handle("a", (0,)), Handle("b", (33,))])
    good = solver.solve({"a": mesh.vertices[0] + 0.1}).copy()
    with pytest.raises(InputError, match=says):
        does(solver)
    assert np.array_equal(solver.pose, good)
    assert np.isfinite(solver.solve()).all()


def test_undeformable_meshes_are_refused():
    ball = sphere()
    with pytest.raises(InputError, match="at most 50 are allowed"):
        ArapSolver(ball, ArapSettings(most_vertices=50))
    with pytest.raises(InputError, match="no faces"):
        ArapSolver(Mesh(ball.vertices, np.empty((0, 3), np.int32)))
    with pytest.raises(InputError, match="finite"):
        ArapSolver(replace(ball, vertices=np.where(np.arange(62)[:, None] == 4, np.nan, ball.vertices)))
    with pytest.raises(InputError, match="no handle"):
        ArapSolver(ball).solve()


def test_single_iteration_moves_the_shape():
    mesh = sphere()
    solver = ArapSolver(mesh, ArapSettings(iterations=1))
    solver.set_handles([Handle("a", (0,)), Handle("b", (33,))])
    first = solver.solve({"a": mesh.vertices[0] + [0.0, 0.3, 0.0]})
    assert np.abs(solver.get_surface() - mesh.vertices).max() > 0.1
    assert np.abs(solver.solve() - first).max() > 1e-4
    with pytest.raises(ValueError, match="read-only"):
        first[0] = 0.0


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_result_is_independent_of_units(scale):
    mesh = sphere()
    shapes = []
    for unit in (1.0, scale):
        solver = ArapSolver(replace(mesh, vertices=mesh.vertices * unit))
        solver.set_handles([Handle("a", (0,)), Handle("b", (33,)), Handle("c", (50,))])
        shapes.append(solver.solve({"a": unit * (mesh.vertices[0] + [0.1, 0.3, 0.0])}) / unit)
    assert np.abs(shapes[0] - shapes[1]).max() < 1e-6
