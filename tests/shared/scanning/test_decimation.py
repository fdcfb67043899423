"""Tests of mesh decimation: within the budget, with the stated error, still closed, and with colours."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.meshes import Mesh
from enliven.scanning import decimate
from enliven.scanning.decimation import distance_bounds


def ball(wobble=0.0, detail=4):
    """Returns a closed ball of 5,120 faces with a wavy surface, red above and blue below."""
    sphere = trimesh.creation.icosphere(detail, 0.3)
    vertices = sphere.vertices * (
        1 + wobble * np.sin(9 * sphere.vertices[:, :1] + 5 * sphere.vertices[:, 1:2])
    )
    colours = np.where(vertices[:, 1:2] > 0, (220, 20, 20), (20, 20, 220)).astype(np.uint8)
    return Mesh(np.asarray(vertices), np.asarray(sphere.faces, np.int32), "ball", colours)


def slow_distance(mesh, point):
    """Returns metres from a point to a mesh, by a dense grid of points on each face."""
    share = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60
    places = (mesh.vertices[mesh.faces][:, None] * share[None, :, :, None]).sum(2)
    return np.linalg.norm(places - point, axis=2).min()


@pytest.mark.slow
@settings(max_examples=12)
@given(faces=st.integers(60, 4000), wobble=st.floats(0.0, 0.15))
def test_decimation_keeps_budget_and_reported_error(faces, wobble):
    mesh = ball(wobble)
    result = decimate(mesh, faces)
    assert 0.8 * faces <= len(result.mesh.faces) <= faces
    errors = np.abs(distance_bounds(result.mesh, mesh.vertices))
    assert (
        np.quantile(errors, 0.99) <= 1.1 * result.distance_99_percentile
        and 0 < result.mean <= result.distance_99_percentile
    )
    low, high = mesh.bounds
    assert (
        np.abs(np.subtract(result.mesh.bounds, (low, high))).max() <= 0.03 + 3 * result.distance_99_percentile
    )
    # Each edge between two faces, once from either side: it is as closed as before.
    f = result.mesh.faces
    sides = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    assert len(np.unique(np.sort(sides, 1), axis=0)) * 2 == len(sides) == len(np.unique(sides, axis=0))
    assert len(np.unique(f)) == len(result.mesh.vertices)
    high = result.mesh.vertices[:, 1]
    assert (result.mesh.colours[high > 0.05] == (220, 20, 20)).all()
    assert (result.mesh.colours[high < -0.05] == (20, 20, 220)).all()


def test_flat_areas_need_few_faces():
    box = trimesh.creation.box((0.4, 0.3, 0.2)).subdivide_to_size(0.02)
    result = decimate(Mesh(np.array(box.vertices), np.array(box.faces, np.int32)), 100)
    assert result.distance_99_percentile < 1e-5 and len(result.mesh.faces) <= 100


@pytest.mark.slow
@settings(max_examples=20)
@given(place=st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_the_distance_is_the_slow_one(place):
    mesh = ball(detail=1)
    distance, slow = distance_bounds(mesh, np.array([place]))[0], slow_distance(mesh, np.array(place))
    # The net's points lie 3 mm apart, and the middle of the ball is as near to all faces.
    assert abs(distance - slow) < 0.004


def test_small_mesh_is_unchanged():
    mesh = ball(detail=1)
    result = decimate(mesh, len(mesh.faces))
    assert result.mesh is mesh and result.mean == result.distance_99_percentile == 0.0
