"""The cost of a deformation graph and its weights on a mesh of a million vertices, and of five million faces.

The mesh is a regular grid of a sphere with folds (a bent, closed surface of one shell), so no file is needed.
The peer builds Sumner's plain graph on the same mesh from standard libraries: trimesh samples 80 points per
node over the area, a greedy Poisson disk keeps the nodes (scipy's kd-tree), and scipy's kd-tree finds the
five nearest nodes of every vertex for the linear weights. It ignores the surface: no geodesics, no
orientation, no joints between parts.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import trimesh
from figure import Figure
from scipy.spatial import cKDTree

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.meshes.mesh import Mesh

NODES, RUNS = 128, 5


def figures() -> Iterator[Figure]:
    """Yields ``embedded.graph_s_1m`` and the figures of five million faces."""
    mesh = make_folded_sphere(1_000_000)
    ours = _time_median(lambda: character_from_graph(mesh, DeformationGraph.build(mesh, NODES), "mesh"))
    theirs = _time_median(lambda: build_plain_graph(mesh))
    yield Figure(
        "embedded.graph_s_1m", ours, "s", "trimesh sampling + scipy kd-tree, Euclidean", theirs / ours
    )
    # It runs in a separate process, since peak memory is measured per process.
    with ProcessPoolExecutor(1, get_context("spawn")) as alone:
        seconds, peak_mib = alone.submit(_measure_large).result()
    yield Figure("embedded.graph_s_5m_faces", seconds, "s")
    yield Figure("embedded.graph_peak_mib_5m_faces", peak_mib, "MiB")


def _measure_large() -> tuple[float, float]:
    """Returns the seconds for five million faces, and the process' peak memory in MiB, including 115 for the
    mesh."""
    small = make_folded_sphere(2000)
    character_from_graph(small, DeformationGraph.build(small, NODES), "warm")
    large = make_folded_sphere(2_500_000)
    start = time.perf_counter()
    character_from_graph(large, DeformationGraph.build(large, NODES), "mesh")
    return time.perf_counter() - start, _measure_peak_mib()


def make_folded_sphere(vertices: int) -> Mesh:
    """Returns a closed surface of about ``vertices`` vertices, 1.75 m tall, with five deep folds along it."""
    rings = max(int(np.sqrt(vertices / 2)), 3)
    around = 2 * rings
    up, turn = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, rings), np.arange(around) * 2 * np.pi / around, indexing="ij"
    )
    radius = 0.5 * np.sin(up) * (1 + 0.45 * np.cos(5 * turn + 2 * up))
    points = np.stack([radius * np.cos(turn), 0.875 * (1 - np.cos(up)), radius * np.sin(turn)], -1).reshape(
        -1, 3
    )
    n = np.arange(rings * around).reshape(rings, around)
    a, b = n[:-1], np.roll(n, -1, 1)[:-1]
    c, d = n[1:], np.roll(n, -1, 1)[1:]
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)])
    ends = [
        np.stack([np.roll(ring, -s), ring, np.full(around, tip)], 1)
        for ring, s, tip in ((n[0], 1, n.size), (n[-1], -1, n.size + 1))
    ]
    tips = np.array([points[n[0]].mean(0), points[n[-1]].mean(0)])
    return Mesh(np.concatenate([points, tips]), np.concatenate([faces, *ends]), "folded sphere")


def build_plain_graph(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Builds the peer's graph: nodes (N, 3), edges (E, 2), and each vertex's nodes and weights (V, 4)."""
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    darts, _ = trimesh.sample.sample_surface(whole, 80 * NODES, seed=0)
    radius = 0.75 * np.sqrt(whole.area / NODES)
    free, tree, kept = np.ones(len(darts), bool), cKDTree(darts), []
    for i in range(len(darts)):
        if free[i]:
            kept.append(i)
            free[tree.query_ball_point(darts[i], radius)] = False
    nodes = cKDTree(darts[kept])
    neighbours = nodes.query(darts[kept], 5)[1][:, 1:]
    pairs = np.stack([np.repeat(np.arange(len(kept)), 4), neighbours.ravel()], 1)
    lengths, nearest = nodes.query(mesh.vertices, 5)
    fall = 1 - lengths[:, :4] / lengths[:, 4:]
    return (
        darts[kept],
        np.unique(np.sort(pairs, 1), axis=0),
        nearest[:, :4],
        fall / fall.sum(1, keepdims=True),
    )


def _time_median(job: Callable[[], object]) -> float:
    """Returns the median seconds, after one run that compiles."""
    job()
    took = []
    for _ in range(RUNS):
        start = time.perf_counter()
        job()
        took.append(time.perf_counter() - start)
    return float(np.median(took))


def _measure_peak_mib() -> float:
    """Returns this process' peak memory. getrusage would include its parent's."""
    status = Path("/proc/self/status")
    if status.exists():
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
