"""Tests of meshes: areas, normals, welding, refining, fitting, and reported repairs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.meshes.kernels import corner_sums, edge_lengths, face_areas, longest_edge, normals_of, shells
from enliven.meshes.mesh import Mesh, extract_submesh, fit_height, refine, weld
from enliven.meshes.repair import repair

BOX_VERTICES = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
BOX_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip


def box() -> Mesh:
    return Mesh(BOX_VERTICES.copy(), np.array(BOX_FACES), "box")


def soup(mesh: Mesh) -> Mesh:
    """Returns the same mesh with three separate vertices for every face, as in flat-shaded files."""
    return Mesh(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), "soup"
    )


def test_area_and_normals_of_a_box():
    mesh = box()
    assert mesh.area == pytest.approx(2 * (2 + 3 + 6))
    middle = BOX_VERTICES.mean(0)
    outward = (mesh.vertices[mesh.faces].mean(1) - middle) * mesh.face_normals()
    assert (outward.sum(1) > 0).all()
    assert ((mesh.vertices - middle) * mesh.vertex_normals() > 0).all()


def test_corner_sums_against_numpy():
    rng = np.random.default_rng(1)
    faces, vectors = rng.integers(0, 20, (50, 3)).astype(np.int32), rng.normal(size=(50, 3))
    slow = np.zeros((20, 3))
    for face, vector in zip(faces, vectors, strict=True):
        for corner in face:
            slow[corner] += vector
    np.testing.assert_allclose(corner_sums(faces, vectors, 20), slow, atol=1e-12)


def test_face_kernels_against_numpy():
    rng = np.random.default_rng(2)
    mesh = Mesh(rng.normal(size=(20, 3)), rng.integers(0, 20, (50, 3)))
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    np.testing.assert_allclose(mesh.face_vectors(), np.cross(b - a, c - a), atol=1e-12)
    sides = np.stack([a - b, b - c, c - a], 1)
    np.testing.assert_allclose(edge_lengths(mesh.vertices, mesh.faces), np.linalg.norm(sides, axis=2))
    normals, bends = mesh.vertex_normals(), np.ones(20)
    for face, normal in zip(mesh.faces, mesh.face_normals(), strict=True):
        for v in face:
            bends[v] = min(bends[v], normals[v] @ normal)
    wanted = np.array([0, 3, 4, 11, 19])
    few, sharpest = normals_of(mesh.vertices, mesh.faces, wanted)
    np.testing.assert_allclose(few, normals[wanted], atol=1e-12)
    np.testing.assert_allclose(sharpest, bends[wanted], atol=1e-12)
    np.testing.assert_allclose(face_areas(mesh.vertices, mesh.faces).sum() / 2, mesh.area)
    assert longest_edge(mesh.vertices, mesh.faces) == pytest.approx(np.linalg.norm(sides, axis=2).max())


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]]),
        (np.zeros((3, 3)), [[0, 1]]),
        (np.zeros((3, 3)), [[0, 1, 3]]),
        (np.zeros((3, 3)), [[0, 1, -1]]),
    ],
)
def test_wrong_arrays_are_refused(vertices, faces):
    with pytest.raises(InputError):
        Mesh(vertices, np.array(faces))


def test_welding_joins_triangle_soup():
    welded, welded_of = weld(soup(box()))
    assert len(welded.vertices) == 8
    np.testing.assert_array_equal(welded.vertices[welded_of], soup(box()).vertices)
    assert shells(welded.faces, 8).max() == 0
    assert shells(soup(box()).faces, 36).max() == 11


def test_welding_takes_minus_zero_for_zero():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0]]), np.array([[0, 1, 2], [3, 2, 1]]))
    assert len(weld(mesh)[0].vertices) == 3


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.floats(0.05, 3.0), st.booleans())
def test_refining_keeps_the_surface_and_opens_no_crack(longest, as_soup):
    start = soup(box()) if as_soup else box()
    fine = refine(start, longest)
    edges = fine.vertices[fine.faces] - np.roll(fine.vertices[fine.faces], -1, 1)
    assert np.linalg.norm(edges, axis=2).max() <= longest
    assert fine.area == pytest.approx(start.area)
    np.testing.assert_array_equal(fine.vertices[: len(start.vertices)], start.vertices)
    welded, _ = weld(fine)
    directed = np.concatenate([welded.faces[:, [0, 1]], welded.faces[:, [1, 2]], welded.faces[:, [2, 0]]])
    forth = {tuple(edge) for edge in directed.tolist()}
    assert len(forth) == len(directed)
    assert all((b, a) in forth for a, b in forth)


def test_refining_stops_before_too_many_vertices():
    assert len(refine(box(), 1e-4, most_vertices=500).vertices) <= 500
    with pytest.raises(InputError):
        refine(box(), 0.0)


def test_refined_vertices_take_the_colour_between():
    mesh = Mesh(
        np.eye(3), np.array([[0, 1, 2]]), colours=np.array([[0, 0, 0], [200, 0, 0], [0, 100, 0]], np.uint8)
    )
    fine = refine(mesh, 1.0)
    at_middle = fine.colours[np.abs(fine.vertices - [0.5, 0.5, 0]).sum(1).argmin()]
    np.testing.assert_array_equal(at_middle, [100, 0, 0])


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_fitting_puts_the_mesh_upright_on_the_floor(up):
    fitted = fit_height(box(), 1.75, up)
    low, high = fitted.bounds
    assert low[1] == pytest.approx(0.0)
    assert high[1] == pytest.approx(1.75)
    np.testing.assert_allclose((low + high)[[0, 2]], 0, atol=1e-12)
    scale = 1.75 / (BOX_VERTICES.max(0))["xyz".index(up)]
    assert fitted.area == pytest.approx(box().area * scale**2)
    # The transform is a rotation, not a reflection, so outward faces stay outward.
    volume = np.einsum("fa,fa->", fitted.vertices[fitted.faces[:, 0]], fitted.face_vectors()) / 6
    assert volume == pytest.approx(6 * scale**3)


def test_a_mesh_without_height_cannot_be_fitted():
    flat = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]]), np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match="flat along the y axis"):
        fit_height(flat, 1.75)
    assert fit_height(flat, 1.75, "z").bounds[1, 1] == pytest.approx(1.75)
    with pytest.raises(InputError):
        fit_height(box(), 0.0)


def test_a_good_mesh_needs_no_repair():
    mesh, notes = repair(box())
    assert notes == []
    assert mesh.area == box().area


def test_every_repair_is_reported():
    vertices = np.concatenate([BOX_VERTICES, [[np.nan, 0, 0], [5, 5, 5]]])
    bad = [[0, 1, 8], [0, 0, 1], [1, 3, 0], [3, 1, 0]]
    mesh, notes = repair(Mesh(vertices, np.array(BOX_FACES + bad)))
    assert len(mesh.vertices) == 8
    assert len(mesh.faces) == 12
    report = " | ".join(notes)
    for words in (
        "1 vertices with invalid positions and 1 faces that use them",
        "1 faces without area",
        "2 duplicate faces",
        "2 of 10",
    ):
        assert words in report


def test_shells_duplicates_and_flat_meshes_are_kept_and_reported():
    two = Mesh(
        np.concatenate([BOX_VERTICES, BOX_VERTICES + 9]), np.concatenate([BOX_FACES, np.array(BOX_FACES) + 8])
    )
    assert "2 separate shells" in repair(two)[1][0]
    mesh, notes = repair(soup(box()))
    assert len(mesh.vertices) == 36
    assert "28 vertices have the same position" in notes[0]
    assert "flat" in repair(Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])))[1][0]


@pytest.mark.parametrize("faces", [np.empty((0, 3)), np.array([[0, 0, 1]])])
def test_a_mesh_without_faces_is_refused(faces):
    with pytest.raises(InputError, match="face"):
        repair(Mesh(BOX_VERTICES, faces))


def test_submesh_keeps_vertex_colours():
    colours = np.arange(24, dtype=np.uint8).reshape(8, 3)
    part = extract_submesh(Mesh(BOX_VERTICES, np.array(BOX_FACES), "box", colours), np.arange(12) < 2)
    np.testing.assert_array_equal(part.vertices, BOX_VERTICES[[0, 1, 2, 3]])
    np.testing.assert_array_equal(part.colours, colours[[0, 1, 2, 3]])
