"""Tests of consistent winding: closed parts face outwards, cavities stay, and one-sided strips are
unchanged.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.meshes.mesh import Mesh
from enliven.meshes.winding import repair_winding

CUBE = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],  # noqa: E501
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def boxes(*places):
    """Returns (vertices, faces) of cubes given by (centre x, half side), all facing outwards."""
    vertices = np.concatenate([CUBE * half + [x, 0, 0] for x, half in places])
    return vertices, np.concatenate([SIDES + 8 * k for k in range(len(places))])


def turned(faces, which):
    return np.where(np.asarray(which)[:, None], faces[:, ::-1], faces)


def oriented(faces):
    """Returns the faces as a set, each rotated to start at its lowest corner. Two sets are equal if the
    winding is.
    """
    return {tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in faces}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.booleans(), min_size=36, max_size=36))
def test_any_flips_of_closed_parts_are_undone(flips):
    vertices, faces = boxes((0, 1), (3, 1), (9, 0.5))
    mesh, notes = repair_winding(Mesh(vertices, turned(faces, flips)))
    assert oriented(mesh.faces) == oriented(faces)
    assert bool(notes) == any(flips)


def test_notes_tell_part_and_whole():
    vertices, faces = boxes((0, 1))
    assert repair_winding(Mesh(vertices, faces[:, ::-1]))[1] == [
        "the faces of the mesh pointed inwards and were flipped"
    ]
    _, notes = repair_winding(Mesh(vertices, turned(faces, np.arange(12) < 3)))
    assert notes == ["3 of 12 faces had another winding than their neighbours and were flipped"]


@pytest.mark.parametrize("all_inside_out", [False, True])
def test_a_cavity_and_a_body_inside_another_keep_their_sense(all_inside_out):
    vertices, faces = boxes((0, 4), (2, 1), (-2, 1))
    wanted = turned(faces, np.arange(36) // 12 == 1)  # the second is a cavity, the third is inside it
    given_faces = wanted[:, ::-1] if all_inside_out else wanted
    mesh, notes = repair_winding(Mesh(vertices, given_faces))
    if all_inside_out:
        assert oriented(mesh.faces) == oriented(wanted) and len(notes) == 1
    else:
        # A cavity faces inwards and stays unchanged, without a note.
        assert oriented(mesh.faces) == oriented(wanted) and notes == []


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_the_larger_side_of_an_open_surface_decides(share):
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    at = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    faces = np.concatenate([np.stack([at, at + 1, at + 7], 1), np.stack([at, at + 7, at + 6], 1)])
    flips = np.random.default_rng(0).permutation(50) < 50 * share
    mesh, _ = repair_winding(Mesh(vertices, turned(faces, flips)))
    assert oriented(mesh.faces) == oriented(faces if share < 0.5 else faces[:, ::-1])


def test_a_strip_with_one_side_is_left_unchanged():
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    across = np.stack(
        [np.cos(angles) * np.cos(angles / 2), np.sin(angles) * np.cos(angles / 2), np.sin(angles / 2)], 1
    )
    vertices = np.concatenate([ring * 3 + across, ring * 3 - across])
    faces = []
    for k in range(12):
        a, b = k, (k + 1) % 12
        c, d = a + 12, b + 12
        if k == 11:
            b, d = d, b
        faces += [[a, b, d], [a, d, c]]
    mesh, notes = repair_winding(Mesh(vertices, np.array(faces)))
    np.testing.assert_array_equal(mesh.faces, faces)
    assert notes == []


def test_texture_coordinates_follow_turned_corners():
    from enliven.meshes.materials import MeshMaterials

    vertices, faces = boxes((0, 1))
    uvs = np.random.default_rng(0).random((12, 3, 1, 2)).astype(np.float32)
    materials = MeshMaterials(("{}",), (), np.zeros(12, np.int32), uvs)
    flips = np.arange(12) % 3 == 0
    wrong = Mesh(vertices, faces, materials=materials).flip_faces(flips)
    mesh, _ = repair_winding(wrong)
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.materials.uvs, uvs)


def test_sides_shared_by_more_than_two_faces_do_not_spread_winding():
    """Two cubes share an edge at which four faces meet. Each cube is a closed part."""
    vertices, faces = boxes((0, 1))
    corner = vertices + np.array([2.0, 2.0, 0.0])
    other = faces + 8
    shared = {8: 6, 9: 7}  # the second cube's edge at (-1, -1) is the first cube's edge at (1, 1)
    other = np.vectorize(lambda v: shared.get(v, v))(other)
    all_faces = np.concatenate([faces, other[:, ::-1]])
    mesh, notes = repair_winding(Mesh(np.concatenate([vertices, corner]), all_faces))
    assert oriented(mesh.faces) == oriented(np.concatenate([faces, other]))
    assert "1 of the 2 parts" in notes[0]
