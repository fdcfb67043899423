"""Tests of unions: closed, with a volume between the larger part and the sum, traceable, and no loss on
failure.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_makers import (
    ball,
    flat_shaded,
    line,
    on_bone,
    partition_of_unity,
    random_skin,
    same_bits,
    tube,
    volume,
    watertight,
)

from enliven.meshes import barycentric
from enliven.meshes.mesh import Mesh
from enliven.modeling.mesh.closing import close_surface
from enliven.modeling.mesh.mesh_cut import cut_across_bone
from enliven.modeling.mesh.mesh_union import unite_meshes

LEAF = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def wall_points():
    """Returns (4, 3) a square that touches the edge of the box at x = 0.125 and y = 0.025."""
    return np.array([[0.125, 0.025, z] for z in (-0.025, 0.025)] + [[0.2, 0.1, z] for z in (0.025, -0.025)])


def box_points(beside=0.0):
    """Returns (8, 3) the corners of a box of 5 cm about (0.1, 0, 0), moved by ``beside`` along x and y."""
    return np.array([[0.1 + beside, beside, 0]]) + 0.025 * np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    )


def box_faces():
    """Returns (12, 3) the outward faces of :func:`box_points`."""
    squares = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return np.array([f for a, b, c, d in squares for f in ((a, b, c), (a, c, d))], np.int32)


def traced(union, first, first_skin, second, second_skin, offset=0):
    """Checks that old vertices away from the seam are unchanged bit for bit."""
    for old, mesh, skin, plus in (
        (union.first, first, first_skin, 0),
        (union.second, second, second_skin, offset),
    ):
        rows = (old >= 0) & ~union.seam
        kept = old[rows]
        assert (np.diff(kept) > 0).all()
        assert same_bits(union.mesh.vertices[rows], mesh.vertices[kept])
        assert same_bits(union.skin.weights[rows], skin.weights[kept])
        assert same_bits(union.skin.indices[rows], (skin.indices[kept] + plus).astype(np.uint16))
    assert ((union.first >= 0) | (union.second >= 0) | union.seam).all()


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    way=st.tuples(*[st.floats(-1, 1)] * 3),
    far=st.floats(0.06, 0.14),
    flat=st.booleans(),
)
def test_the_union_is_closed_and_between_the_larger_and_the_sum(way, far, flat):
    way = np.array(way) + np.array([0, 0, 1e-3])
    first, second = ball(0.1), ball(0.06, far * way / np.linalg.norm(way), name="other")
    if flat:
        first, second = flat_shaded(first), flat_shaded(second)
    skins = random_skin(len(first.vertices), 5, 1), random_skin(len(second.vertices), 3, 2)
    union = unite_meshes(first, skins[0], second, skins[1], offset=5)
    assert union.fused and not union.notes
    assert watertight(union.mesh) and partition_of_unity(union.skin)
    parts = volume(first), volume(second)
    assert max(parts) * (1 - 1e-9) <= volume(union.mesh) <= sum(parts) * (1 + 1e-9)
    traced(union, first, skins[0], second, skins[1], 5)
    # At one place there is one weight, or the surface would tear when it moves.
    order = np.lexsort(union.mesh.vertices.T)
    same = (np.diff(union.mesh.vertices[order], axis=0) == 0).all(1) & union.seam[order[1:]]
    assert not same.any() or flat
    assert same_bits(union.skin.weights[order[1:][same]], union.skin.weights[order[:-1][same]])


def test_faces_away_from_the_seam_stay_in_their_order():
    first, second = ball(0.1), ball(0.06, (0.1, 0, 0))
    union = unite_meshes(first, on_bone(first, 0), second, on_bone(second, 1))
    old = union.first[union.mesh.faces]
    whole = (old >= 0).all(1)
    kept = {tuple(face): number for number, face in enumerate(first.faces.tolist())}
    numbers = [kept[tuple(face)] for face in old[whole].tolist() if tuple(face) in kept]
    assert len(numbers) > 0.7 * len(first.faces)
    assert (np.diff(numbers) > 0).all()


def needles(mesh, near):
    """Returns the number of faces at ``near`` vertices whose shape quality is below a tenth of an even
    triangle's.
    """
    corners = mesh.vertices[mesh.faces[near[mesh.faces].any(1)]]
    sides = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return int((2 * np.sqrt(3) * area / (sides**2).sum(1) < 0.1).sum())


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(way=st.tuples(*[st.floats(-1, 1)] * 3), far=st.floats(0.06, 0.14))
def test_a_tidy_seam_has_better_triangles_and_the_same_shape(way, far):
    way = np.array(way) + np.array([0, 0, 1e-3])
    first, second = ball(0.1), ball(0.06, far * way / np.linalg.norm(way), name="other")
    skins = random_skin(len(first.vertices), 5, 1), random_skin(len(second.vertices), 3, 2)
    plain = unite_meshes(first, skins[0], second, skins[1], offset=5)
    tidy = unite_meshes(first, skins[0], second, skins[1], offset=5, tidy=True)
    assert watertight(tidy.mesh) and partition_of_unity(tidy.skin)
    assert volume(tidy.mesh) == pytest.approx(volume(plain.mesh), rel=5e-3)
    traced(tidy, first, skins[0], second, skins[1], 5)
    assert needles(tidy.mesh, tidy.seam) <= needles(plain.mesh, plain.seam)
    for old in ("first", "second"):
        rows = getattr(tidy, old)
        assert set(rows[rows >= 0]) == set(getattr(plain, old)[getattr(plain, old) >= 0])
    assert len(tidy.mesh.vertices) <= len(plain.mesh.vertices)


def test_a_flat_shaded_seam_is_not_torn_by_tidying():
    first, second = flat_shaded(ball(0.1)), flat_shaded(ball(0.06, (0.1, 0.01, 0.02)))
    skins = on_bone(first, 0), on_bone(second, 1)
    union = unite_meshes(first, skins[0], second, skins[1], tidy=True)
    assert union.fused and watertight(union.mesh)


def test_union_restores_cut_mesh():
    mesh, skeleton = tube(), line([[0, 0, 0], [0, 0, 2.0]])
    skin = random_skin(len(mesh.vertices), 2)
    cut = cut_across_bone(mesh, skin, skeleton, 1, 0.37)
    union = unite_meshes(cut.near.mesh, cut.near.skin, cut.far.mesh, cut.far.skin)
    assert union.fused and watertight(union.mesh)
    assert volume(union.mesh) == pytest.approx(volume(mesh), rel=1e-9)
    # The caps are gone. Except at the rim, all vertices existed before.
    assert len(union.mesh.vertices) - len(mesh.vertices) == union.seam.sum()
    from_near = cut.near.kept[union.first[union.first >= 0]]
    assert set(range(len(mesh.vertices))) - set(from_near) <= set(cut.far.kept)


def test_colours_are_kept_and_blank_where_there_were_none():
    first, second = ball(0.1), ball(0.06, (0.1, 0, 0))
    red = np.tile(np.array([250, 10, 20], np.uint8), (len(first.vertices), 1))
    first = Mesh(first.vertices, first.faces, "red", red)
    union = unite_meshes(first, on_bone(first, 0), second, on_bone(second, 1))
    own = (union.first >= 0) & ~union.seam
    assert (union.mesh.colours[own] == [250, 10, 20]).all()
    assert (union.mesh.colours[(union.second >= 0) & ~union.seam] == 204).all()


def test_hole_filling_is_reported():
    first, second = ball(0.1), ball(0.06, (0.1, 0, 0))
    holed = Mesh(first.vertices, first.faces[8:], "holed")
    union = unite_meshes(holed, on_bone(holed, 0), second, on_bone(second, 1))
    assert union.fused and any("hole" in note for note in union.notes)
    assert watertight(union.mesh) and partition_of_unity(union.skin)
    turned = Mesh(first.vertices, first.faces[:, ::-1], "turned")
    union = unite_meshes(turned, on_bone(turned, 0), second, on_bone(second, 1))
    assert union.fused and any("pointed inwards" in note for note in union.notes)
    assert watertight(union.mesh) and volume(union.mesh) > volume(first)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (ball(0.05, (1.0, 0, 0)), "do not touch"),
        (ball(0.05), "inside"),
        (Mesh(ball(0.06, (0.1, 0, 0)).vertices, ball().faces[::2], "sieve"), "not a solid"),
        (Mesh(ball(0.06, (0.1, 0, 0)).vertices, np.tile(ball().faces[:1], (3, 1)), "leaf"), "not a solid"),
    ],
)
def test_unfusable_meshes_are_joined_without_loss(other, why):
    first = ball(0.1)
    union = unite_meshes(first, on_bone(first, 0), other, on_bone(other, 0), offset=3)
    assert not union.fused and why in union.notes[0]
    assert same_bits(union.mesh.vertices[: len(first.vertices)], first.vertices)
    assert same_bits(union.mesh.vertices[len(first.vertices) :], other.vertices)
    assert same_bits(union.mesh.faces[: len(first.faces)], first.faces)
    assert same_bits(union.mesh.faces[len(first.faces) :] - np.int32(len(first.vertices)), other.faces)
    assert set(np.unique(union.skin.indices[len(first.vertices) :, 0])) == {3}
    assert union.failed == (why == "not a solid")


OTHER = ball(0.06, (0.1, 0, 0), name="other")
HOLED = np.concatenate([OTHER.faces[np.arange(len(OTHER.faces)) % 40 > 0], OTHER.faces[1:2]])
BOXES = np.concatenate([box_points(), box_points(0.05)])
NO_SOLIDS = {
    "doubled and holed": Mesh(OTHER.vertices, HOLED),
    "two boxes with one edge": Mesh(BOXES, np.concatenate([box_faces(), box_faces() + 8])),
    "a box and a wall on its edge": Mesh(
        np.concatenate([box_points(), wall_points()]), np.concatenate([box_faces(), LEAF + 8])
    ),
    "a box and a leaf": Mesh(
        np.concatenate([box_points(), wall_points() + 0.01]), np.concatenate([box_faces(), LEAF + 8])
    ),
}
NO_SOLIDS |= {f"{name}, flat-shaded": flat_shaded(mesh) for name, mesh in NO_SOLIDS.items()}


@pytest.mark.parametrize("name", NO_SOLIDS)
def test_union_of_open_mesh_keeps_outer_surface(name):
    first, other = ball(0.1), NO_SOLIDS[name]
    skins = random_skin(len(first.vertices), 5, 1), random_skin(len(other.vertices), 3, 2)
    union = unite_meshes(first, skins[0], other, skins[1], 5)
    assert union.fused and not union.failed and partition_of_unity(union.skin)
    corners = union.mesh.vertices[union.mesh.faces]
    assert (np.linalg.norm(corners.mean(1), axis=1) > 0.095).all(), "nothing is left within the ball"
    have = [frozenset(map(tuple, face)) for face in corners.tolist()]
    assert len(set(have)) == len(have)
    far = other.faces[np.linalg.norm(other.vertices, axis=1)[other.faces].min(1) > 0.105]
    assert {frozenset(map(tuple, face)) for face in other.vertices[far].tolist()} <= set(have)
    if "holed" in name:
        assert watertight(union.mesh)


@given(st.integers(0, 10**6), st.integers(1, 40), st.integers(3, 12))
def test_any_triangles_become_a_closed_surface_and_leaves(seed, count, points):
    rng = np.random.default_rng(seed)
    faces = np.array([rng.permutation(points)[:3] for _ in range(count)], np.int32)
    faces = faces[np.unique(np.sort(faces, 1), axis=0, return_index=True)[1]]
    mesh = Mesh(rng.normal(size=(points, 3)), faces)
    closed = close_surface(mesh, np.arange(points))
    assert same_bits(closed.vertices[:points], mesh.vertices)
    own = faces[~closed.leaf]
    assert (closed.vertices[closed.faces[: len(own)]] == mesh.vertices[own]).all()
    rebuilt = closed.vertices[:points]
    for of, how in closed.made:
        rebuilt = np.concatenate([rebuilt, how(rebuilt[of])])
    np.testing.assert_allclose(rebuilt, closed.vertices, atol=1e-12)
    label = closed.label[closed.faces]
    sides = [(a, b) for face in label.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)]
    assert {(b, a) for a, b in sides} == set(sides)


def test_barycentric_shares_add_up_to_the_point():
    rng = np.random.default_rng(3)
    corners = rng.random((50, 3, 3))
    share = rng.dirichlet([1, 1, 1], 50)
    points = np.einsum("nk,nkd->nd", share, corners)
    np.testing.assert_allclose(barycentric(points, corners), share, atol=1e-9)
    flat = np.zeros((1, 3, 3))
    np.testing.assert_allclose(barycentric(np.ones((1, 3)), flat).sum(1), 1)
