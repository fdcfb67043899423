"""Tests of baked surfaces: motion by few transforms is recovered, the stated error is true, and nothing
tears.
"""

import weakref
from itertools import pairwise

import made_puppets
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.examples.baking.bake import bake_surface, sample_farthest
from enliven.examples.baking.maps import Maps, compute_gram_matrix, compute_moments
from enliven.examples.baking.morphs import bake_morphs
from enliven.examples.baking.settings import BakeSettings
from enliven.examples.baking.weights import fit_weights
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector, rotate, to_matrix

laws = settings(deadline=None, max_examples=10)
SEEDS = st.integers(0, 2**31)


def bent(mesh, frames=30, turn=1.2):
    """Returns (F, V, 3) a tube that bends, twists and is squashed. Its deformation differs in each frame."""
    out = []
    for t in np.linspace(0, 2 * np.pi, frames):
        y = mesh.vertices[:, 1]
        vector = np.stack([0.3 * np.sin(2 * t) * y, 0.4 * np.sin(t) * y, turn * np.cos(t) * y], 1)
        stretch = 1 + 0.2 * np.sin(3 * t) * y
        low = np.stack([0 * y, y, 0 * y], 1)
        across = (mesh.vertices - low) / np.sqrt(stretch)[:, None]
        out.append(rotate(from_rotation_vector(vector), low * stretch[:, None] + across))
    return np.array(out)


def played(baked, vertices, frame):
    """Returns (V, 3) the baked surface in a frame, computed one vertex at a time."""
    out = np.zeros_like(vertices)
    for v, rest in enumerate(vertices):
        for k, w in zip(baked.skin.indices[v], baked.skin.weights[v], strict=True):
            moved = baked.linear[frame, k] @ (rest - baked.pivots[k]) + baked.places[frame, k]
            out[v] += float(w) * moved
    return out


@pytest.mark.slow
@pytest.mark.parametrize("shear", [False, True])
def test_a_bending_tube_is_followed_and_the_error_is_the_true_one(shear):
    mesh = made_puppets.tube()
    frames = bent(mesh)
    wanted = BakeSettings(rms=0.0005, worst=0.004)
    baked = bake_surface(mesh, lambda: frames, frames, [0, 40], wanted, shear)
    shown = np.array([played(baked, mesh.vertices, f) for f in range(len(frames))])
    off = np.linalg.norm(shown - frames, axis=2)
    assert baked.error.rms <= wanted.rms * baked.error.size
    assert baked.error.worst <= wanted.worst * baked.error.size
    assert np.sqrt((off**2).mean()) == pytest.approx(baked.error.rms, rel=1e-3)
    assert off.max() == pytest.approx(baked.error.worst, rel=1e-3)
    assert off[baked.error.frame, baked.error.vertex] == pytest.approx(off.max(), rel=1e-3)
    assert "% of the mesh's size" in str(baked.error)
    if not shear:
        squares = np.einsum("fkba,fkbc->fkac", baked.linear, baked.linear)
        along = np.einsum("kab,fkac,kcd->fkbd", baked.axes, squares, baked.axes)
        assert np.abs(along * (1 - np.eye(3))).max() < 1e-9, "a node cannot say that"
        assert np.linalg.det(baked.linear).min() > 0


def test_more_transforms_follow_more_closely():
    mesh = made_puppets.tube()
    frames = bent(mesh)
    errors = [
        bake_surface(mesh, lambda: frames, frames, [], BakeSettings(rms=0, worst=0, nodes=n, first=4)).error
        for n in (4, 8, 16, 32)
    ]
    assert all(2 * b.rms < 1.5 * a.rms for a, b in pairwise(errors))


@laws
@given(SEEDS)
def test_rigid_surface_stays_rigid(seed):
    rng = np.random.default_rng(seed)
    mesh = made_puppets.tube(8, 6)
    turns, moves = from_rotation_vector(2 * rng.normal(size=(6, 3))), rng.normal(size=(6, 3))
    frames = np.array([rotate(turn, mesh.vertices) + move for turn, move in zip(turns, moves, strict=True)])
    baked = bake_surface(mesh, lambda: frames, frames, [3])
    assert baked.error.worst < 1e-5
    np.testing.assert_allclose(baked.linear, to_matrix(turns)[:, None] + 0 * baked.linear, atol=1e-3)


def test_weights_are_bounded_at_most_four_and_sum_to_one():
    mesh = made_puppets.tube()
    frames = bent(mesh)
    baked = bake_surface(mesh, lambda: frames, frames, [5])
    weights = baked.skin.weights.astype(float)
    assert (weights >= 0).all() and np.abs(weights.sum(1) - 1).max() < 1e-6
    assert baked.skin.indices.max() < len(baked.pivots) and baked.skin.indices.shape == (len(weights), 4)
    assert set(map(tuple, baked.pivots.tolist())) <= set(map(tuple, mesh.vertices.tolist()))


def test_vertices_at_one_position_stay_together():
    mesh = made_puppets.tube(8, 6)
    loose = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    frames = bent(mesh)[:, mesh.faces].reshape(30, -1, 3)
    baked = bake_surface(loose, lambda: frames, frames, [0])
    whole = mesh.faces.ravel()
    for v in range(len(mesh.vertices)):
        rows = np.flatnonzero(whole == v)
        assert (baked.skin.indices[rows] == baked.skin.indices[rows[0]]).all()
        assert (baked.skin.weights[rows] == baked.skin.weights[rows[0]]).all()


def test_a_flat_sheet_and_two_shells_are_followed():
    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 2, 15))
    flat = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    cells = [9 * r + c for r in range(14) for c in range(8)]
    faces = np.array([f for a in cells for f in ([a, a + 1, a + 9], [a + 1, a + 10, a + 9])], np.int32)
    both = Mesh(
        np.concatenate([flat, flat + np.array([0, 0, 0.5])]), np.concatenate([faces, faces + len(flat)])
    )
    frames = bent(both, turn=0.6)
    baked = bake_surface(both, lambda: frames, frames, [0])
    assert baked.error.worst < 0.015 * baked.error.size
    sizes = np.linalg.norm(baked.linear, axis=2)
    assert sizes.min() > 0.2 and sizes.max() < 5.0


def test_frames_are_not_kept():
    mesh = made_puppets.tube(8, 6)
    moved = bent(mesh, 300)
    alive, most = weakref.WeakSet(), [0]

    class Counted(np.ndarray):
        pass

    def frames():
        for frame in moved:
            given = frame.copy().view(Counted)
            alive.add(Box(given))
            most[0] = max(most[0], len(alive))
            yield given

    class Box:
        def __init__(self, array):
            array.box = self

    bake_surface(mesh, frames, moved, [0], BakeSettings(frames=20, nodes=8, first=8))
    assert most[0] < 40


def test_frames_far_from_one_another_are_chosen():
    assert sample_farthest(np.zeros((5, 2)), 9).tolist() == [0, 1, 2, 3, 4]
    line = np.array([0.0, 0.1, 5.0, 0.2, 10.0, 0.3])[:, None]
    assert sample_farthest(line, 3).tolist() == [0, 2, 4]
    assert sample_farthest(np.zeros((50, 2)), 9).tolist() == [0]


def random_fit(seed, vertices=20, nodes=5, frames=4):
    rng = np.random.default_rng(seed)
    rest, pivots = rng.normal(size=(vertices, 3)), rng.normal(size=(nodes, 3))
    indices = np.array([rng.permutation(nodes)[:4] for _ in range(vertices)], np.int32)
    weights = rng.dirichlet(np.ones(4), vertices)
    return rng, rest, pivots, indices, weights, rng.normal(size=(vertices, frames, 3))


@laws
@given(SEEDS)
def test_maps_are_those_of_the_plain_system(seed):
    _, rest, pivots, indices, weights, wanted = random_fit(seed, 60)
    design = np.zeros((len(rest), len(pivots), 4))
    for v in range(len(rest)):
        for k, w in zip(indices[v], weights[v], strict=True):
            design[v, k] += w * np.append(rest[v] - pivots[k], 1.0)
    flat = design.reshape(len(rest), -1)
    gram = compute_gram_matrix(rest, pivots, indices, weights)
    np.testing.assert_allclose(gram.reshape(flat.shape[1], -1), flat.T @ flat, atol=1e-12)
    right = compute_moments(rest, pivots, indices, weights, wanted.reshape(60, -1))
    expected = np.einsum("vka,vj->kaj", design, wanted.reshape(60, -1))
    np.testing.assert_allclose(right, expected, atol=1e-12)
    rigid = 1e-9
    fitted = Maps(rest, pivots, indices, weights, rigid).solve_maps(wanted)
    shown = np.einsum("vka,fkac->vfc", design, fitted)
    best = np.stack([flat @ np.linalg.lstsq(flat, wanted[:, f], None)[0] for f in range(4)], 1)
    assert ((shown - wanted) ** 2).sum() <= ((best - wanted) ** 2).sum() * (1 + 1e-3) + 1e-6


@laws
@given(SEEDS, st.floats(0.0, 2.0))
def test_weights_are_those_of_the_slow_way(seed, smooth):
    rng, rest, pivots, indices, weights, wanted = random_fit(seed)
    maps = rng.normal(size=(5, 4, 4, 3))
    candidates = np.argsort(rng.random((20, 5)), 1).astype(np.int32)
    candidates[::3, 3:] = -1
    near = rng.integers(0, 20, 60)
    starts = np.sort(np.concatenate([[0, 60], rng.integers(0, 61, 19)]))
    around = (candidates, near, starts, smooth)
    expected = slow_weights(rest, wanted, pivots, maps, *around, indices, weights)
    flat = maps.transpose(0, 2, 1, 3).reshape(5, 4, -1)
    fit_weights(rest, wanted.reshape(20, -1), pivots, np.ascontiguousarray(flat), *around, indices, weights)
    for v in range(20):
        dense = np.zeros(5)
        np.add.at(dense, indices[v], weights[v])
        np.testing.assert_allclose(dense, expected[v], atol=1e-7)


def slow_weights(rest, wanted, pivots, maps, candidates, near, starts, smooth, indices, weights):
    """Returns (V, K) weights as the docstrings define them, by NumPy's solver."""
    dense = np.zeros((len(rest), len(pivots)))
    for v in range(len(rest)):
        np.add.at(dense[v], indices[v], weights[v])
    out = dense.copy()
    for v in range(len(rest)):
        used = [k for k in candidates[v] if k >= 0]
        moved = [np.append(rest[v] - pivots[k], 1.0) @ maps[k] - wanted[v] for k in used]
        gram = np.array([[(a * b).sum() for b in moved] for a in moved])
        around = near[starts[v] : starts[v + 1]]
        pull = dense[around][:, used].mean(0) if len(around) else np.zeros(len(used))
        least = 1e-10 * np.trace(gram) / len(used)

        def cost(w, gram=gram, pull=pull):
            return w @ gram @ w + smooth * ((w - pull) ** 2).sum()

        free = list(range(len(used)))
        while True:
            part = gram[np.ix_(free, free)] + (smooth + least) * np.eye(len(free))
            system = np.block([[part, np.ones((len(free), 1))], [np.ones(len(free)), 0.0]])
            solution = np.linalg.solve(system, np.append(smooth * pull[free], 1.0))[:-1]
            if solution.min() >= 0 and len(free) <= 4:
                break
            free.pop(int(solution.argmin()))
        new = np.zeros(len(used))
        new[free] = solution
        before = dense[v, used]
        if abs(before.sum() - 1) < 1e-6 and cost(new) >= cost(before):
            continue
        out[v] = 0.0
        out[v, used] = new
    return out


def test_rounds_never_increase_the_error():
    mesh = made_puppets.tube()
    frames = bent(mesh, 12)
    errors = []
    for rounds in (1, 2, 3, 6):
        plain = BakeSettings(rounds=rounds, smooth=0.0, rms=0, worst=0, nodes=8, first=8, rigid=1e-9)
        errors.append(bake_surface(mesh, lambda: frames, frames, [0], plain, shear=True).error.rms)
    assert all(b <= a * (1 + 1e-6) for a, b in pairwise(errors))
    assert errors[-1] < 0.9 * errors[0]


def test_shapes_that_are_added_up_are_found_as_morph_targets():
    mesh = made_puppets.tube(8, 6)
    rng = np.random.default_rng(3)
    shapes, weights = 0.1 * rng.normal(size=(3, *mesh.vertices.shape)), rng.normal(size=(20, 3))
    frames = mesh.vertices + np.einsum("fn,nva->fva", weights, shapes)
    baked = bake_morphs(mesh, lambda: frames, weights, BakeSettings(rms=1e-9, worst=1e-9))
    assert len(baked.targets) == 3 and baked.error.worst < 1e-9
    shown = mesh.vertices + np.einsum("fn,nva->fva", baked.weights, baked.targets)
    np.testing.assert_allclose(shown, frames, atol=1e-9)
    few = bake_morphs(mesh, lambda: frames, weights, BakeSettings(targets=2, rms=0, worst=0))
    off = mesh.vertices + np.einsum("fn,nva->fva", few.weights, few.targets) - frames
    assert few.error.rms == pytest.approx(np.sqrt((off**2).sum(2).mean()))
    assert few.error.worst == pytest.approx(np.sqrt((off**2).sum(2).max()))


def test_normals_of_morph_targets_are_near_the_true_ones():
    mesh = made_puppets.tube()
    frames = bent(mesh)
    baked = bake_morphs(mesh, lambda: frames, frames)
    rest = mesh.vertex_normals()
    shown = rest + np.einsum("fn,nva->fva", baked.weights, baked.normals)
    shown /= np.linalg.norm(shown, axis=2, keepdims=True)
    true = np.array([Mesh(frame, mesh.faces).vertex_normals() for frame in frames])
    assert np.degrees(np.arccos(np.clip((shown * true).sum(2), -1, 1))).mean() < 6.0
