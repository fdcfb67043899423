"""Tests of Poisson-disk sampling with the orientation-aware distance of eq. 6."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.sampling import (
    distance_matrix,
    orientation_aware_distance,
    sample_poisson_disk,
    sample_uniform_points,
    throw_darts,
)
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh


def as_printed(p, n_p, q, n_q):
    """Returns the distance of eq. 6, implemented literally."""

    def dist(to, normal, point):
        d = point - to
        return np.linalg.norm(d + 2 * (d @ normal) * normal)

    facing = max(0.0, float(n_p @ n_q))
    return min(dist(q, n_q, p), dist(p, n_p, q)) / facing if facing > 1e-9 else np.inf


def unit(v):
    return v / np.linalg.norm(v)


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_the_distance_is_eq_6_symmetric_and_no_less_than_euclidean(seed):
    rng = np.random.default_rng(seed)
    p, q = rng.normal(size=(2, 3))
    n_p, n_q = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    d = orientation_aware_distance(p, n_p, q, n_q)
    assert d == pytest.approx(as_printed(p, n_p, q, n_q))
    assert d == orientation_aware_distance(q, n_q, p, n_p)
    assert d >= np.linalg.norm(p - q) - 1e-12


def test_opposite_faces_are_infinitely_far():
    up = np.array([0.0, 0, 1])
    assert orientation_aware_distance(np.zeros(3), up, np.array([0, 0, 0.01]), -up) == np.inf
    assert orientation_aware_distance(np.zeros(3), up, np.array([0.0, 0, 2]), up) == pytest.approx(6.0)
    assert orientation_aware_distance(np.zeros(3), up, np.array([2.0, 0, 0]), up) == pytest.approx(2.0)


def slow_throw(positions, normals, radius):
    kept = []
    for i in range(len(positions)):
        near = (as_printed(positions[i], normals[i], positions[j], normals[j]) < radius for j in kept)
        if not any(near):
            kept.append(i)
    return kept


@pytest.mark.parametrize("radius", [0.02, 0.3, 5.0])
def test_grid_search_matches_brute_force(radius):
    rng = np.random.default_rng(3)
    positions = rng.random((300, 3))
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert throw_darts(positions, normals, radius).tolist() == slow_throw(positions, normals, radius)


@pytest.fixture(scope="module")
def chair():
    return make_chair()


@pytest.mark.parametrize("nodes", [1, 2, 17, 128])
def test_exactly_as_many_nodes_as_asked_for_and_none_too_near(chair, nodes):
    samples = sample_poisson_disk(chair, nodes, seed=4)
    assert samples.positions.shape == (nodes, 3)
    assert distance_matrix(samples).min() >= samples.radius


def test_a_given_radius_covers_the_surface(chair):
    samples = sample_poisson_disk(chair, radius=0.15, seed=1)
    assert distance_matrix(samples).min() >= 0.15
    probes = sample_uniform_points(chair, 400, np.random.default_rng(9))
    pairs = zip(probes.positions, probes.normals, strict=True)
    nodes = list(zip(samples.positions, samples.normals, strict=True))
    gaps = [min(orientation_aware_distance(p, n, q, m) for q, m in nodes) for p, n in pairs]
    assert np.quantile(gaps, 0.99) < 0.15


def test_the_same_seed_gives_the_same_samples(chair):
    a, b, other = (
        sample_poisson_disk(chair, 64, seed=5),
        sample_poisson_disk(chair, 64, seed=5),
        sample_poisson_disk(chair, 64, seed=6),
    )
    np.testing.assert_array_equal(a.positions, b.positions)
    assert not np.array_equal(a.positions, other.positions)


def test_scattering_is_even_over_the_area():
    # Two triangles, of areas 1/2 and 9/2.
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [10, 0, 0], [13, 0, 0], [10, 3, 0]])
    mesh = Mesh(vertices, np.array([[0, 1, 2], [3, 4, 5]]))
    samples = sample_uniform_points(mesh, 5000, np.random.default_rng(0))
    assert (samples.faces == 1).mean() == pytest.approx(0.9, abs=0.01)
    small = samples.positions[samples.faces == 0]
    np.testing.assert_allclose(small.mean(0), [1 / 3, 1 / 3, 0], atol=0.03)
    np.testing.assert_allclose(samples.normals, np.tile([0.0, 0, 1], (5000, 1)), atol=1e-12)


def test_normals_are_smooth_on_a_smooth_surface_and_not_across_an_edge():
    angles = np.linspace(0, 2 * np.pi, 25)[:-1]
    ring = np.stack([np.cos(angles), np.zeros(24), np.sin(angles)], 1)
    vertices = np.concatenate([ring, ring + np.array([0, 1.0, 0])])
    i, j = np.arange(24), np.roll(np.arange(24), -1)
    sides = np.concatenate([np.stack([i, i + 24, j], 1), np.stack([j, i + 24, j + 24], 1)])
    tube = sample_uniform_points(Mesh(vertices, sides), 500, np.random.default_rng(0))
    round_normals = tube.positions * [1, 0, 1]
    round_normals /= np.linalg.norm(round_normals, axis=1, keepdims=True)
    assert (tube.normals * round_normals).sum(1).min() > 0.999
    step = Mesh(
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [1, 1, 0], [1, 1, 1]]),
        np.array([[0, 2, 1], [0, 3, 2], [1, 5, 4], [1, 2, 5]]),
    )
    corner = sample_uniform_points(step, 200, np.random.default_rng(0))
    assert np.isclose(np.abs(corner.normals).max(1), 1).all()


def test_invalid_mesh_is_not_sampled(chair):
    point = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    for call in (
        lambda: sample_poisson_disk(point),
        lambda: sample_poisson_disk(chair, 0),
        lambda: sample_poisson_disk(chair, radius=0.0),
        lambda: sample_poisson_disk(chair, radius=float("nan")),
    ):
        with pytest.raises(InputError):
            call()
