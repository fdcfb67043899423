"""Tests of sphere proxies: they cover the surface, follow its motion, are few, and are deterministic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.spheres import SphereProxies, SphereSettings, pack_spheres, select_greedy_cover
from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError
from enliven.rotation import from_rotation_vector, to_matrix

vectors = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)


def ball(rings: int, radius: float = 0.5, nodes: int = 7) -> Character:
    """Returns a triangulated sphere whose vertices follow random nodes."""
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)[None]
    xyz = np.sin(polar) * np.cos(around), np.cos(polar) + 0 * around, np.sin(polar) * np.sin(around)
    vertices = radius * np.stack(xyz, -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    quads = np.stack([a, b, b + 2 * rings, a + 2 * rings], -1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return character_of(vertices, faces, nodes)


def character_of(vertices: np.ndarray, faces: np.ndarray, nodes: int = 7) -> Character:
    rng = np.random.default_rng(1)
    weights = rng.random((len(vertices), 4))
    skin = SkinWeights(
        rng.integers(0, nodes, (len(vertices), 4)).astype(np.uint16),
        (weights / weights.sum(1, keepdims=True)).astype(np.float32),
    )
    pivots = rng.normal(0, 0.3, (nodes, 3)).astype(np.float32)
    edges = np.zeros((0, 2), np.int32)
    return Character("ball", vertices.astype(np.float32), faces.astype(np.int32), skin, pivots, edges)


def rigid(character: Character, turn: np.ndarray, shift: np.ndarray, scale: float = 1.0) -> Pose:
    """Returns the pose that transforms all nodes by one similarity."""
    matrix = scale * to_matrix(from_rotation_vector(turn))
    linear = np.tile(matrix, (len(character.pivots), 1, 1))
    return Pose(character.id, 0, linear, character.pivots @ matrix.T + shift)


def depths(proxies: SphereProxies, points: np.ndarray) -> np.ndarray:
    """Returns (P,) metres from each point to the nearest centre."""
    return np.linalg.norm(points[:, None] - proxies.rest[None], axis=2).min(1)


@given(rings=st.integers(4, 24), inset=st.floats(0, 0.9), edges=st.floats(0.5, 8))
@settings(max_examples=30, deadline=None)
def test_every_vertex_and_every_face_is_covered(rings, inset, edges):
    character = ball(rings)
    proxies = pack_spheres(character, SphereSettings(edges=edges, inset=inset, most=200))
    assert 1 <= len(proxies) <= 200
    rng = np.random.default_rng(rings)
    shares = rng.dirichlet(np.ones(3), len(character.faces))
    inside = np.einsum("fc,fca->fa", shares, character.vertices[character.faces].astype(float))
    assert depths(proxies, character.vertices.astype(float)).max() <= proxies.radius * (1 + 1e-6)
    # Between the samples of a face, a quarter of the radius apart at most, a point may lie a little outside.
    assert depths(proxies, inside).max() <= 1.3 * proxies.radius


@given(turn=vectors, shift=vectors, scale=st.floats(0.2, 4))
@settings(max_examples=30, deadline=None)
def test_spheres_follow_rigid_motion_exactly(turn, shift, scale):
    character = ball(8)
    proxies = pack_spheres(character)
    pose = rigid(character, turn, shift, scale)
    expected = scale * proxies.rest @ to_matrix(from_rotation_vector(turn)).T + shift
    np.testing.assert_allclose(proxies.centres(pose), expected, atol=1e-5)
    assert proxies.compute_posed_radius(pose) == pytest.approx(scale * proxies.radius, rel=1e-6)


def test_a_sphere_follows_its_own_nodes_as_a_vertex_would():
    character = ball(8)
    proxies = pack_spheres(character)
    rng = np.random.default_rng(4)
    linear = rng.normal(0, 1, (7, 3, 3)).astype(np.float32)
    pose = Pose("ball", 0, linear, rng.normal(0, 1, (7, 3)).astype(np.float32))
    slow = np.zeros((len(proxies), 3))
    for s in range(len(proxies)):
        for node, weight in zip(proxies.indices[s], proxies.weights[s], strict=True):
            at = proxies.rest[s] - character.pivots[node]
            slow[s] += weight * (linear[node] @ at + pose.positions[node])
    np.testing.assert_allclose(proxies.centres(pose), slow, atol=1e-5)
    assert np.allclose(proxies.weights.sum(1), 1)


def test_the_packing_is_that_of_the_plain_rule():
    """Compares with a plain version of pick, place and prune that tests every vertex against every sphere."""
    rng = np.random.default_rng(0)
    points = rng.random((400, 3))
    inner = points + rng.normal(0, 0.02, points.shape)
    order, radius = rng.permutation(400), 0.17
    slow: list[int] = []
    for p in order:
        if not slow or np.linalg.norm(inner[slow] - points[p], axis=1).min() > radius:
            slow.append(int(p))
    assert select_greedy_cover(points, inner, order, radius, 400).tolist() == slow
    assert len(select_greedy_cover(points, inner, order, radius, len(slow) - 1)) == 0


def test_radius_matches_paper_within_limits():
    character = ball(40, radius=0.3)
    corners = character.vertices[character.faces].astype(float)
    mean = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2).mean()
    free = SphereSettings(smallest=1e-4, largest=10.0, most=4096, inset=0.0)
    assert pack_spheres(character, free).radius == pytest.approx(4 * mean)
    assert pack_spheres(character, SphereSettings(smallest=0.2, largest=0.3)).radius == 0.2
    assert pack_spheres(character, SphereSettings(largest=0.03, most=4096)).radius == 0.03


def test_the_same_mesh_is_packed_the_same_way():
    first, second = pack_spheres(ball(16)), pack_spheres(ball(16))
    assert np.array_equal(first.rest, second.rest) and np.array_equal(first.indices, second.indices)


def test_a_mesh_of_two_large_faces_has_no_holes():
    vertices = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2]], float)
    proxies = pack_spheres(character_of(vertices, np.array([[0, 1, 2], [0, 2, 3]])))
    grid = np.stack(np.meshgrid(np.linspace(0, 2, 60), [0.0], np.linspace(0, 2, 60)), -1).reshape(-1, 3)
    assert depths(proxies, grid).max() < 1.25 * proxies.radius


def test_a_huge_mesh_gives_few_spheres():
    proxies = pack_spheres(ball(250, radius=1.0))
    assert len(proxies) <= SphereSettings().most


def test_degenerate_meshes_are_covered_or_refused():
    point = np.zeros((3, 3))
    assert len(pack_spheres(character_of(point, np.array([[0, 1, 2]])))) == 1
    with pytest.raises(InputError, match="not finite"):
        pack_spheres(character_of(np.full((3, 3), np.nan), np.array([[0, 1, 2]])))
