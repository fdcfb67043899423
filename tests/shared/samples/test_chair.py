"""Tests of the sample chair: closed, in one piece, and of a size that fits a person."""

import numpy as np
import pytest
from sample_meshes.isosurface import surface_of

from enliven.meshes.kernels import shells
from enliven.meshes.mesh import Mesh
from enliven.meshes.repair import repair
from enliven.samples.shipped import load_sample


@pytest.fixture(scope="module")
def chair():
    return load_sample("chair")


def test_the_chair_is_one_closed_surface_that_faces_outwards(chair):
    assert 10_000 <= len(chair.vertices) <= 20_000
    assert shells(chair.faces, len(chair.vertices)).max() == 0
    edges = np.concatenate([chair.faces[:, [0, 1]], chair.faces[:, [1, 2]], chair.faces[:, [2, 0]]])
    forth = {tuple(e) for e in edges.tolist()}
    assert len(forth) == len(edges)
    assert all((b, a) in forth for a, b in forth)
    assert np.einsum("fa,fa->", chair.vertices[chair.faces[:, 0]], chair.face_vectors()) > 0
    assert repair(chair)[1] == []


def test_its_edges_are_short_enough_to_bend(chair):
    corners = chair.vertices[chair.faces]
    lengths = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
    assert lengths.max() < 0.03
    assert np.median(lengths) < 0.02


def test_standing_person_fits_into_the_chair(chair):
    low, high = chair.bounds
    assert low[1] == 0.0
    assert high[1] == pytest.approx(1.75, abs=0.03)
    np.testing.assert_allclose(low[0], -high[0], atol=1e-3)
    feet = chair.vertices[chair.vertices[:, 1] < 0.02]
    back, front = feet[feet[:, 2] < 0.2], feet[feet[:, 2] > 0.2]
    for pair in (back, front):
        left, right = pair[pair[:, 0] > 0].mean(0), pair[pair[:, 0] < 0].mean(0)
        assert 0.40 < left[0] - right[0] < 0.50
    assert abs(back[:, 2].mean()) < 0.08
    # The armrests are in front of the back, at the height of a bent elbow, with free ends.
    arms = chair.vertices[(chair.vertices[:, 1] > 0.95) & (chair.vertices[:, 2] > 0.15)]
    assert 1.0 < arms[:, 1].mean() < 1.15
    assert np.abs(arms[:, 0]).min() > 0.2
    assert arms[:, 2].max() > 0.4


def test_chair_is_symmetric_and_coloured(chair):
    mirrored = chair.vertices * [-1, 1, 1]
    probe = mirrored[::97]
    gaps = np.linalg.norm(probe[:, None] - chair.vertices[None], axis=2).min(1)
    assert gaps.max() < 0.02
    seat = (np.abs(chair.vertices - [0, 0.88, 0.25]).max(1) < 0.1) & (chair.vertices[:, 1] > 0.86)
    blue_over_red = chair.colours[seat][:, 2].astype(int) - chair.colours[seat][:, 0]
    assert (blue_over_red > 0).all()
    legs = chair.vertices[:, 1] < 0.25
    assert (chair.colours[legs][:, 0] > chair.colours[legs][:, 2]).all()


def test_surface_nets_find_a_ball():
    def field(points):
        return np.linalg.norm(points - 0.1, axis=1) - 0.5

    vertices, faces = surface_of(field, np.full(3, -0.6), np.full(3, 0.8), 0.05)
    np.testing.assert_allclose(field(vertices), 0, atol=1e-9)
    ball = Mesh(vertices, faces)
    assert ball.area == pytest.approx(4 * np.pi * 0.25, rel=0.01)
    outward = ((vertices - 0.1) * ball.vertex_normals()).sum(1)
    assert outward.min() > 0
