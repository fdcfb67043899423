"""Measures skinning on one processor thread, against libigl's linear blend skinning.

libigl (tutorial 403) calls ``lbs_matrix(V, W)`` once, which gives a dense (V, 4 J) matrix. Every frame
multiplies it with the stacked transforms. Normals are ``per_vertex_normals`` of the result. Here, the product
is NumPy's in double precision, like libigl's own, limited to one thread. For a million vertices that matrix
would take 4 GB, so the peer multiplies the matrix of the first 100,000 ten times.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import igl
import numpy as np
from figure import Figure
from graph_figures import make_folded_sphere
from skinned_normals import skin_normals
from threadpoolctl import threadpool_limits

from enliven import rotation
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.document.character import Character, Pose

NODES, SIZES, MOST = 128, (10_000, 100_000, 1_000_000), 100_000


def figures() -> Iterator[Figure]:
    """Yields vertices and normals per second at three sizes. The largest one gives the figures without a
    size."""
    for size in SIZES:
        mesh = make_folded_sphere(size)
        character = character_from_graph(mesh, DeformationGraph.build(mesh, NODES), "mesh")
        pose = _make_waving_pose(character)
        count = len(character.vertices)
        rest = mesh.vertex_normals().astype(np.float32)
        out = np.empty((count, 3), np.float32)
        vertices = count / _time_fastest(lambda: skin_vertices(character, pose, out))  # noqa: B023
        normals = count / _time_fastest(lambda: skin_normals(character, pose, rest, out))  # noqa: B023
        with threadpool_limits(1):
            their_vertices, their_normals = _time_peer(character, pose)
        label = {10_000: "_10k", 100_000: "_100k", 1_000_000: ""}[size]
        yield Figure(
            f"skinning.vertices_per_s{label}", vertices, "1/s", "libigl LBS", vertices / their_vertices
        )
        yield Figure(
            f"skinning.normals_per_s{label}",
            normals,
            "1/s",
            "libigl per-vertex normals",
            normals / their_normals,
        )


def _make_waving_pose(character: Character) -> Pose:
    """Returns a pose in which every node is rotated and moved depending on its position."""
    turns = np.sin(3 * character.pivots.astype(np.float64))
    linear = rotation.to_matrix(rotation.from_rotation_vector(turns)).astype(np.float32)
    return Pose(character.id, 0, linear, (character.pivots + 0.1 * turns).astype(np.float32))


def _time_peer(character: Character, pose: Pose) -> tuple[float, float]:
    """Returns libigl's vertices and normals per second. Its vertices are compared with ours."""
    count = min(len(character.vertices), MOST)
    weights = np.zeros((count, len(character.pivots)))
    np.put_along_axis(
        weights, character.skin.indices[:count].astype(np.int64), character.skin.weights[:count], 1
    )
    whole = character.vertices.astype(np.float64)
    matrix = igl.lbs_matrix(whole[:count], weights)
    stacked = np.concatenate(list(pose.matrices(character.pivots).transpose(0, 2, 1)), 0).astype(np.float64)
    np.testing.assert_allclose(matrix @ stacked, skin_vertices(character, pose)[:count], atol=1e-4)
    faces = character.faces.astype(np.int64)
    vertices = count / _time_fastest(lambda: matrix @ stacked)
    return vertices, len(whole) / _time_fastest(lambda: igl.per_vertex_normals(whole, faces))


def _time_fastest(job: Callable[[], object], seconds: float = 1.0) -> float:
    """Returns the seconds of the fastest run of as many as fit into ``seconds``, at least three."""
    job()
    took: list[float] = []
    while len(took) < 3 or sum(took) < seconds:
        start = time.perf_counter()
        job()
        took.append(time.perf_counter() - start)
    return min(took)
