"""Tests of the generated cactus: one closed symmetric surface, and key poses that a person can perform."""

from __future__ import annotations

import numpy as np
import pytest
from sample_meshes.cactus_puppet import cactus_project
from scipy.spatial import cKDTree

from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.project import are_identical
from enliven.examples.puppet_examples import examples_from_key_poses, find_missing_examples
from enliven.meshes.mesh import Mesh
from enliven.samples.shipped import load_sample


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return load_sample("cactus")


def test_cactus_is_closed_and_symmetric(mesh: Mesh) -> None:
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, 1)], -1).reshape(-1, 2), 1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0
    away, other = cKDTree(mesh.vertices).query(mesh.vertices * [-1.0, 1.0, 1.0])
    assert away.max() < 1e-9
    assert mesh.colours is not None
    assert (mesh.colours == mesh.colours[other]).all(1).mean() > 0.97


def test_cactus_stands_on_the_floor_with_two_arms(mesh: Mesh) -> None:
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    assert low[1] == pytest.approx(0.0)
    assert 1.3 < high[1] < 1.4
    assert high[0] > 0.4
    assert 5_000 < len(mesh.vertices) < 12_000


def test_the_puppet_can_move_and_is_the_same_every_time() -> None:
    project = cactus_project(0.05)
    puppet = project.puppet("cactus")
    assert find_missing_examples(project, puppet) == ()
    assert len({point.vertex for point in puppet.points}) == len(puppet.points)
    examples = examples_from_key_poses(project, puppet)
    assert len(examples) > len(puppet.poses)
    assert are_identical(project, cactus_project(0.05))


def test_arms_follow_the_performers_arms() -> None:
    project = cactus_project(0.05)
    puppet = project.puppet("cactus")
    examples = examples_from_key_poses(project, puppet)
    hand = examples.find_point("left hand")
    heights = examples.sources[:, hand, 1], examples.targets[:, hand, 1]
    assert np.corrcoef(*heights)[0, 1] > 0.8
    feet = [puppet.index(name) for name in ("left foot", "right foot")]
    for pose in puppet.poses:
        assert pose.places[feet, 1].min() == pytest.approx(puppet.rest[feet, 1].min(), abs=0.02)


@pytest.mark.slow
def test_every_key_pose_is_a_shape_that_keeps_its_volume_within_reason(mesh: Mesh) -> None:
    project = cactus_project(0.03)
    puppet = project.puppet("cactus")
    surface = PuppetSurface(puppet.mesh, [p.vertex for p in puppet.points], None, puppet.surface)

    def volume(vertices: np.ndarray) -> float:
        a, b, c = (vertices[puppet.mesh.faces[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    at_rest = volume(puppet.mesh.vertices)
    for pose in puppet.poses:
        vertices = surface.solve_from_rest(pose.places)
        assert np.isfinite(vertices).all()
        assert 0.6 < volume(vertices) / at_rest < 1.5
