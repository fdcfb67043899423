"""Tests of symmetry planes: found for any orientation of the mesh, and none if the mesh is asymmetric."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.modeling.mesh.mirror_plane import TOLERANCE, plane_of_symmetry


def box(low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [[q[0], q[a], q[a + 1]] for q in quads for a in (1, 2)]
    return Mesh(np.asarray(low) + corners * (np.asarray(high) - low), np.array(faces, np.int32))


def together(*meshes):
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def beast(lean=0.0):
    """Returns a body with a head in front, a tail, and two arms. The left arm (-x) may be higher."""
    return together(
        box([-0.2, 0.0, -0.4], [0.2, 0.5, 0.4]),
        box([-0.1, 0.4, 0.35], [0.1, 0.7, 0.6]),
        box([0.15, 0.2, 0.1], [0.6, 0.3, 0.2]),
        box([-0.6, 0.2 + lean, 0.1], [-0.15, 0.3 + lean, 0.2]),
        box([-0.03, 0.1, -0.9], [0.03, 0.2, -0.35]),
    )


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.001, 1000.0))
def test_plane_is_found_in_any_orientation(seed, scale):
    rng = np.random.default_rng(seed)
    turn = rotation.to_matrix(rotation.normalized(rng.normal(size=4)))
    shift = rng.normal(0, 3, 3)
    mesh = beast()
    plane = plane_of_symmetry(Mesh(scale * (mesh.vertices @ turn.T + shift), mesh.faces))
    assert plane is not None
    normal, point = np.array(plane.normal), np.array(plane.point)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert abs(normal @ turn[:, 0]) > 0.9995
    # Points of the true plane lie in it.
    inside = scale * (np.array([[0, 0, 0], [0, 0.5, 0.4], [0, 0.1, -0.9]]) @ turn.T + shift)
    assert np.abs((inside - point) @ normal).max() < 0.01 * scale


@pytest.mark.slow
def test_nearly_symmetric_counts_and_asymmetric_does_not():
    assert plane_of_symmetry(beast(0.02)) is not None
    assert plane_of_symmetry(beast(0.4)) is None
    rng = np.random.default_rng(1)
    crumpled = beast()
    crumpled = Mesh(crumpled.vertices + rng.normal(0, 0.15, crumpled.vertices.shape), crumpled.faces)
    assert plane_of_symmetry(crumpled) is None
    assert 0 < TOLERANCE < 0.05


@pytest.mark.parametrize("wide, axis", [([0.6, 1.0, 0.4], 0), ([0.4, 0.5, 1.2], 2), ([0.5, 3.0, 0.05], 0)])
def test_box_gets_the_plane_between_left_and_right(wide, axis):
    plane = plane_of_symmetry(box(-np.array(wide) / 2, np.array(wide) / 2))
    assert plane is not None
    assert abs(plane.normal[axis]) > 0.999
    assert np.abs(plane.point[axis]) < 0.01


@pytest.mark.slow
def test_the_sign_and_the_answer_are_always_the_same():
    mesh = beast()
    first, second = plane_of_symmetry(mesh), plane_of_symmetry(mesh)
    assert first == second and max(first.normal, key=abs) > 0


def test_a_fine_side_and_a_coarse_one_are_still_alike():
    halves = [box([0.0, 0, 0], [0.5, 1, 0.3]), box([-0.5, 0, 0], [0.0, 1, 0.3])]
    from enliven.meshes.mesh import refine

    plane = plane_of_symmetry(together(refine(halves[0], 0.05), halves[1]))
    assert plane is not None and abs(plane.normal[0]) > 0.999


def test_without_area_there_is_no_plane_to_find():
    with pytest.raises(InputError, match="area"):
        plane_of_symmetry(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)))
