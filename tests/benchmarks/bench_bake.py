"""Baking a solved surface to transforms.

Measures seconds for 300 frames of 10,000 vertices, and one round of the fit against the same round in plain
NumPy and SciPy. The surface is a bean that bends, twists and is squashed by formulas, so that no solver is
included in the time. The peer finds the weights of each vertex with scipy.optimize.nnls over the same
candidates. It enforces the sum of one by a row with a large weight, and then fits the four largest again. The
peer finds the transforms with scipy.sparse's splu.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sparse
from figure import Figure
from scipy.optimize import nnls
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int, Int32
from enliven.examples.baking.bake import bake_surface
from enliven.examples.baking.maps import Maps, skin_one_frame
from enliven.examples.baking.nodes import EdgeGraph, Seeds
from enliven.examples.baking.settings import BakeSettings
from enliven.examples.baking.weights import fit_weights
from enliven.meshes.mesh import Mesh
from enliven.rotation import from_rotation_vector, rotate

VERTICES, FRAMES, NODES, FITTED = 10_000, 300, 48, 100
_FREE = 1e-7
"""A near-zero stiffness, so that transforms are hardly pulled towards rotations, as in the peer."""


def figures() -> Iterator[Figure]:
    """Yields the time of the whole bake, its error, and the time of one round."""
    mesh = make_bean(VERTICES)
    frames = animate_bean(mesh, FRAMES)
    settings = BakeSettings(frames=FITTED)
    baked = bake_surface(mesh, lambda: frames, frames[:, ::97], [0], settings)
    seconds = _time_fastest(lambda: bake_surface(mesh, lambda: frames, frames[:, ::97], [0], settings), 3)
    yield Figure("examples.bake_s_10k", seconds, "s")
    yield Figure("examples.bake_rms_10k", 100 * baked.error.rms / baked.error.size, "% of the size")
    yield Figure("examples.bake_worst_10k", 100 * baked.error.worst / baked.error.size, "% of the size")
    yield Figure("examples.bake_nodes_10k", len(baked.pivots), "transforms")
    yield _measure_round(mesh, np.ascontiguousarray(frames[:: FRAMES // FITTED][:FITTED].transpose(1, 0, 2)))


def _measure_round(mesh: Mesh, wanted: Float) -> Figure:
    """Measures one round: weights of all vertices, then transforms of all frames. Both implementations have
    the same start.
    """
    net = EdgeGraph(mesh)
    seeds = Seeds(net, [0], NODES)
    pivots, candidates = mesh.vertices[seeds.vertices], seeds.find_nearest(8)
    indices = np.zeros((len(mesh.vertices), 4), np.int32)
    indices[:, 0] = candidates[:, 0]
    weights = np.zeros((len(mesh.vertices), 4))
    weights[:, 0] = 1.0
    start = Maps(mesh.vertices, pivots, indices, weights, _FREE).solve_maps(wanted)
    near, starts = net.lengths.indices.astype(np.int64), net.lengths.indptr.astype(np.int64)

    def ours() -> float:
        by_node = np.ascontiguousarray(start.transpose(1, 2, 0, 3)).reshape(NODES, 4, -1)
        own, weight = indices.copy(), weights.copy()
        flat = wanted.reshape(len(wanted), -1)
        fit_weights(mesh.vertices, flat, pivots, by_node, candidates, near, starts, 0.0, own, weight)
        maps = Maps(mesh.vertices, pivots, own, weight, _FREE).solve_maps(wanted)
        return _compute_error(mesh.vertices, pivots, own, weight, maps, wanted)

    fitted = ours()
    took = _time_fastest(ours, 5)
    begun = time.perf_counter()
    own, weight = compute_plain_weights(mesh.vertices, pivots, start, candidates, wanted)
    maps = compute_plain_maps(mesh.vertices, pivots, own, weight, wanted)
    theirs = time.perf_counter() - begun
    off = _compute_error(mesh.vertices, pivots, own, weight, maps, wanted)
    np.testing.assert_allclose(fitted, off, rtol=0.2, err_msg="both rounds should come out alike")
    return Figure("examples.bake_round_s_10k", took, "s", "numpy and scipy", theirs / took)


def compute_plain_weights(
    rest: Float, pivots: Float, maps: Float, candidates: Int32, wanted: Float
) -> tuple[Int32, Float]:
    """Returns (V, 4) transforms and weights by non-negative least squares, one vertex at a time."""
    indices, weights = np.zeros((len(rest), 4), np.int32), np.zeros((len(rest), 4))
    for v, among in enumerate(candidates):
        local = np.concatenate([rest[v] - pivots[among], np.ones((len(among), 1))], 1)
        away = np.einsum("ca,fcab->cfb", local, maps[:, among]) - wanted[v]
        away = away.reshape(len(among), -1)
        heavy = 1e3 * max(float(np.linalg.norm(away)), 1e-12)
        matrix = np.concatenate([away.T, np.full((1, len(among)), heavy)])
        right = np.append(np.zeros(matrix.shape[0] - 1), heavy)
        largest = np.argsort(nnls(matrix, right)[0])[-4:]
        solution = nnls(matrix[:, largest], right)[0]
        indices[v], weights[v] = among[largest], solution / solution.sum()
    return indices, weights


def compute_plain_maps(rest: Float, pivots: Float, indices: Int32, weights: Float, wanted: Float) -> Float:
    """Returns (F, K, 4, 3) unconstrained affine transforms, by a sparse factorisation of the normal
    equations."""
    count, frames = len(pivots), wanted.shape[1]
    rows = np.repeat(np.arange(len(rest)), 16)
    columns = (4 * indices[:, :, None] + np.arange(4)).ravel()
    local = np.concatenate([rest[:, None] - pivots[indices], np.ones((*indices.shape, 1))], 2)
    values = (weights[:, :, None] * local).ravel()
    design = sparse.csc_matrix((values, (rows, columns)), shape=(len(rest), 4 * count))
    normal = (design.T @ design + 1e-8 * sparse.eye(4 * count)).tocsc()
    solution = splu(normal).solve(design.T @ wanted.reshape(len(rest), -1))
    return np.ascontiguousarray(solution.reshape(count, 4, frames, 3).transpose(2, 0, 1, 3))


def make_bean(count: int) -> Mesh:
    """Returns a closed tube of about ``count`` vertices, one metre high."""
    around = round(np.sqrt(count / 3))
    rings = count // around
    angles = np.linspace(0, 2 * np.pi, around, endpoint=False)
    lean = np.linspace(0, np.pi, rings + 2)[1:-1]
    wide, height = 0.15 * np.sin(lean) ** 0.5, 0.5 * (1 - np.cos(lean))
    x, z = np.outer(wide, np.cos(angles)), np.outer(wide, np.sin(angles))
    middle = np.stack([x, np.repeat(height[:, None], around, 1), z], 2).reshape(-1, 3)
    vertices = np.concatenate([[[0.0, 0.0, 0.0]], middle, [[0.0, 1.0, 0.0]]])
    own = 1 + np.arange(rings * around).reshape(rings, around)
    right = np.roll(own, -1, 1)
    a, b, c, d = (part.ravel() for part in (own[:-1], right[:-1], own[1:], right[1:]))
    top = len(vertices) - 1
    faces = [np.stack([a, c, b], 1), np.stack([b, c, d], 1)]
    faces += [np.stack([np.zeros(around, int), own[0], right[0]], 1)]
    faces += [np.stack([np.full(around, top), right[-1], own[-1]], 1)]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), "bean")


def animate_bean(mesh: Mesh, count: int) -> Float:
    """Returns (F, V, 3) metres: the bean bends to all sides, twists, and is squashed and stretched."""
    y, t = mesh.vertices[:, 1], np.linspace(0, 4 * np.pi, count)[:, None]
    bend = [np.sin(t) * y, 0.7 * np.sin(0.7 * t + 1) * y**2, 1.2 * np.cos(1.3 * t) * y]
    turns = from_rotation_vector(np.stack(bend, 2))
    stretch = 1 + 0.25 * np.sin(2 * t) * np.sin(np.pi * y)
    low = np.stack([0 * y, y, 0 * y], 1)
    across = (mesh.vertices - low) / np.sqrt(stretch)[..., None]
    return np.asarray(rotate(turns, low * stretch[..., None] + across))


def _compute_error(
    rest: Float, pivots: Float, indices: Int, weights: Float, maps: Float, wanted: Float
) -> float:
    """Returns the root mean square error, metres."""
    out, total = np.empty_like(rest), 0.0
    for frame in range(len(maps)):
        skin_one_frame(rest, pivots, indices, weights, maps[frame], out)
        total += float(((out - wanted[:, frame]) ** 2).sum(1).mean())
    return float(np.sqrt(total / len(maps)))


def _time_fastest(job: Callable[[], object], repeats: int) -> float:
    """Returns the seconds of the fastest of ``repeats`` runs."""
    job()
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        job()
        times.append(time.perf_counter() - begun)
    return min(times)
