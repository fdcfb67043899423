"""Tests of cuts: both sides are closed, their volumes add up, and everything away from the cut is unchanged
bit for bit.
"""

import warnings

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

from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.modeling.mesh.cut_loops import join_chains, order_chains, signed_area, winding_number
from enliven.modeling.mesh.cut_plan import CutSettings
from enliven.modeling.mesh.cut_surfaces import PlaneCut, StrokeCut
from enliven.modeling.mesh.mesh_cut import cut_across_bone, cut_by_stroke
from enliven.modeling.mesh.mesh_union import unite_meshes
from enliven.modeling.skinning.heat_diffusion import bone_heat

FROM_Z = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
"""Projection of a view onto the x and y axes."""


def unchanged(piece, mesh, skin):
    """Checks that kept vertices, weights and whole faces are unchanged and in the same order."""
    old = piece.kept >= 0
    kept = piece.kept[old]
    assert (np.diff(kept) > 0).all()
    assert same_bits(piece.mesh.vertices[old], mesh.vertices[kept])
    assert same_bits(piece.skin.indices[old], skin.indices[kept])
    assert same_bits(piece.skin.weights[old], skin.weights[kept])
    whole = (piece.kept[piece.mesh.faces] >= 0).all(1)
    inside = np.isin(mesh.faces, kept).all(1)
    assert same_bits(piece.kept[piece.mesh.faces[whole]].astype(np.int32), mesh.faces[inside])


@settings(max_examples=25, deadline=None)
@given(
    u=st.floats(0.02, 0.98),
    tilt=st.tuples(*[st.floats(-0.8, 0.8)] * 2),
    flat=st.booleans(),
    fine=st.booleans(),
)
def test_two_closed_parts_make_the_whole(u, tilt, flat, fine):
    mesh = tube()
    mesh = flat_shaded(mesh) if flat else mesh
    skin = random_skin(len(mesh.vertices), 6)
    surface = PlaneCut([0, 0, 0.3 + 1.4 * u], [*tilt, 1.0])
    cut = cut_by_stroke(mesh, skin, surface, settings=CutSettings(fine=fine))
    assert volume(cut.near.mesh) + volume(cut.far.mesh) == pytest.approx(volume(mesh), rel=1e-9)
    for piece in (cut.near, cut.far):
        assert volume(piece.mesh) > 0
        assert watertight(piece.mesh)
        assert partition_of_unity(piece.skin)
        unchanged(piece, mesh, skin)
    together = np.concatenate([cut.near.kept[cut.near.kept >= 0], cut.far.kept[cut.far.kept >= 0]])
    assert (np.sort(together) == np.arange(len(mesh.vertices))).all()


def test_cut_lies_on_the_requested_surface():
    mesh, skeleton = tube(step=0.05), line([[0, 0, 0], [0, 0, 2.0]])
    cut = cut_across_bone(mesh, on_bone(mesh, 1), skeleton, 1, 0.37)
    # The cut may be shifted slightly to avoid vertices.
    assert cut.near.mesh.bounds[1, 2] == pytest.approx(0.74, abs=0.15 * 0.1)
    assert cut.far.mesh.bounds[0, 2] == pytest.approx(cut.near.mesh.bounds[1, 2], abs=1e-12)
    caps = cut.near.mesh.faces[-cut.near.caps :]
    assert np.ptp(cut.near.mesh.vertices[caps][:, :, 2]) < 1e-12
    assert (cut.near.mesh.face_normals()[-cut.near.caps :, 2] > 0.999).all()


def two_legs():
    legs = [tube(0.1, 1.0), tube(0.1, 1.0)]
    shifted = legs[1].vertices + np.array([0.5, 0, 0])
    faces = np.concatenate([legs[0].faces, legs[1].faces + len(legs[0].vertices)])
    return Mesh(np.concatenate([legs[0].vertices, shifted]), faces, "legs")


def test_only_the_limb_around_the_bone_is_cut():
    mesh = two_legs()
    half = len(mesh.vertices) // 2
    skin = on_bone(mesh, 1)
    indices = skin.indices.copy()
    indices[half:, 0] = 0
    skin = type(skin)(indices, skin.weights)
    cut = cut_across_bone(mesh, skin, line([[0, 0, 0], [0, 0, 1.0]]), 1, 0.5)
    # The other leg follows the root, so it stays with the root as a whole.
    assert set(range(half, 2 * half)) <= set(cut.near.kept)
    assert watertight(cut.near.mesh) and watertight(cut.far.mesh)
    assert volume(cut.far.mesh) == pytest.approx(volume(mesh) / 4, rel=0.1)


def test_a_shell_that_is_not_cut_goes_with_its_bones():
    limb, eye = tube(0.1, 1.0), ball(0.02, (0.3, 0.0, 0.1))
    mesh = Mesh(
        np.concatenate([limb.vertices, eye.vertices]),
        np.concatenate([limb.faces, eye.faces + len(limb.vertices)]),
    )
    skeleton = line([[0, 0, 0], [0, 0, 0.5], [0, 0, 1.0]])
    skin = on_bone(mesh, 2)
    cut = cut_across_bone(mesh, skin, skeleton, 1, 0.5)
    # The shell is on the near side of the plane, but follows a bone beyond the cut.
    assert set(range(len(limb.vertices), len(mesh.vertices))) <= set(cut.far.kept)


def test_second_cut_separates_ring_and_is_reported():
    import trimesh

    torus = trimesh.creation.torus(0.5, 0.1)
    mesh = Mesh(torus.vertices, torus.faces, "ring")
    skeleton = line([[0.5, -0.3, 0], [0.5, 0.3, 0]])
    cut = cut_across_bone(mesh, on_bone(mesh, 1), skeleton, 1, 0.5)
    assert any("at another position" in note for note in cut.notes)
    assert watertight(cut.near.mesh) and watertight(cut.far.mesh)
    assert volume(cut.near.mesh) + volume(cut.far.mesh) == pytest.approx(volume(mesh), rel=1e-9)


def test_stroke_cuts_only_crossed_parts():
    mesh = two_legs()
    turned = Mesh(mesh.vertices[:, [0, 2, 1]] * [1, 1, -1], mesh.faces, "legs")
    skin = random_skin(len(mesh.vertices), 3)
    through_one = StrokeCut([[-0.2, 0.4], [0.0, 0.5], [0.2, 0.45]], FROM_Z)
    cut = cut_by_stroke(turned, skin, through_one)
    assert watertight(cut.near.mesh) and watertight(cut.far.mesh)
    parts = sorted([volume(cut.near.mesh), volume(cut.far.mesh)])
    assert sum(parts) == pytest.approx(volume(turned), rel=1e-9)
    assert parts[0] < 0.3 * volume(turned)
    through_both = StrokeCut([[-0.2, 0.4], [0.7, 0.5]], FROM_Z)
    both = cut_by_stroke(turned, skin, through_both)
    assert volume(both.near.mesh) == pytest.approx(0.45 * volume(turned), rel=0.1)


def test_a_crooked_stroke_leaves_crooked_caps_that_still_fit():
    mesh = ball(0.5, detail=4)
    stroke = StrokeCut([[-0.7, -0.1], [-0.1, -0.1], [0.0, 0.2], [0.7, 0.2]], FROM_Z)
    cut = cut_by_stroke(mesh, None, stroke)
    assert watertight(cut.near.mesh) and watertight(cut.far.mesh)
    assert volume(cut.near.mesh) + volume(cut.far.mesh) == pytest.approx(volume(mesh), rel=1e-9)
    new = cut.near.mesh.vertices[cut.near.kept < 0]
    rim = new[np.linalg.norm(new, axis=1) > 0.49]
    left, right = rim[rim[:, 0] < -0.2], rim[rim[:, 0] > 0.1]
    np.testing.assert_allclose(left[:, 1], -0.1, atol=0.02)
    np.testing.assert_allclose(right[:, 1], 0.2, atol=0.02)


def test_a_stroke_on_a_posed_mesh_cuts_the_mesh_at_rest():
    mesh = tube(step=0.05)
    turned = np.stack([mesh.vertices[:, 2], mesh.vertices[:, 1], -mesh.vertices[:, 0]], 1)
    cut = cut_by_stroke(mesh, None, StrokeCut([[0.8, 1.0], [0.8, -1.0]], FROM_Z), posed=turned)
    assert {round(float(m.bounds[1, 2]), 1) for m in (cut.near.mesh, cut.far.mesh)} == {0.8, 2.0}
    assert volume(cut.near.mesh) + volume(cut.far.mesh) == pytest.approx(volume(mesh), rel=1e-9)


def test_colours_and_weights_run_on_over_the_cut():
    mesh = tube(step=0.25)
    shade = (mesh.vertices[:, 2] * 100).astype(np.uint8)
    mesh = Mesh(mesh.vertices, mesh.faces, "tube", np.stack([shade] * 3, 1))
    skin = on_bone(mesh, 0)
    share = (mesh.vertices[:, 2] / 2).astype(np.float32)
    indices, weights = skin.indices.copy(), skin.weights.copy()
    indices[:, 1], weights[:, 0], weights[:, 1] = 1, 1 - share, share
    cut = cut_by_stroke(mesh, type(skin)(indices, weights), PlaneCut([0, 0, 0.9], [0, 0, 1]))
    new = cut.far.kept < 0
    z = cut.far.mesh.vertices[new, 2]
    np.testing.assert_allclose(cut.far.mesh.colours[new], np.stack([100 * z] * 3, 1), atol=1)
    of_one = np.where(cut.far.skin.indices == 1, cut.far.skin.weights, 0).sum(1)[new]
    np.testing.assert_allclose(of_one, z / 2, atol=1e-6)


def test_open_mesh_is_capped_only_at_the_cut():
    mesh = tube()
    open_tube = Mesh(mesh.vertices, mesh.faces[: -2 * 12], "open")
    cut = cut_by_stroke(open_tube, None, PlaneCut([0, 0, 1.03], [0, 0, 1]))
    for piece in (cut.near, cut.far):
        edges = np.sort(piece.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        assert (counts == 1).sum() == 12 and (counts <= 2).all()
    half = Mesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 0].mean(1) > 0], "shell")
    cut = cut_by_stroke(half, None, PlaneCut([0, 0, 1.03], [0, 0, 1]))
    assert cut.near.caps == 0 and any("open" in note for note in cut.notes)


def test_bone_outside_its_limb_cuts_its_skin():
    mesh = two_legs()
    half = len(mesh.vertices) // 2
    skeleton = Skeleton(
        ("a", "b", "c"), np.array([-1, 0, 0]), np.array([[0.15, 0, 0], [0.15, 0, 1.0], [0.5, 0, 1.0]])
    )
    skin = on_bone(mesh, 1)
    skin.indices[half:, 0] = 2
    cut = cut_across_bone(mesh, skin, skeleton, 1, 0.5)
    assert any("outside" in note for note in cut.notes)
    assert volume(cut.far.mesh) == pytest.approx(volume(mesh) / 4, rel=0.1)
    assert set(range(half, 2 * half)) <= set(cut.near.kept)


def test_a_bone_through_nothing_takes_shells_asunder():
    body, leg = ball(0.1), tube(0.05, 0.5)
    mesh = Mesh(
        np.concatenate([body.vertices, leg.vertices + np.array([0.5, 0, 0])]),
        np.concatenate([body.faces, leg.faces + len(body.vertices)]),
    )
    skeleton = line([[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0.5]])
    skin = on_bone(mesh, 2)
    skin.indices[: len(body.vertices), 0] = 0
    cut = cut_across_bone(mesh, skin, skeleton, 1, 0.5)
    assert any("divided without a cut" in note for note in cut.notes)
    assert list(cut.near.kept) == list(range(len(body.vertices)))
    assert cut.near.caps == cut.far.caps == 0
    assert same_bits(cut.near.mesh.faces, body.faces)


def test_a_bone_within_a_body_takes_its_limb_and_does_not_halve_the_body():
    trunk, branch = tube(0.3, 2.0, 20, 0.09), tube(0.12, 1.2, 16, 0.08)
    turned = branch.vertices @ np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]).T
    branch = Mesh(turned + np.array([0.05, 0.01, 1.0]), branch.faces, "branch")
    union = unite_meshes(trunk, on_bone(trunk, 1), branch, on_bone(branch, 3))
    skeleton = Skeleton(
        ("a", "b", "c", "d", "e"),
        np.array([-1, 0, 1, 1, 3]),
        np.array([[0, 0, 0], [0, 0, 1.0], [0, 0, 2], [0.3, 0.01, 1.0], [1.2, 0.01, 1]]),
    )
    skin = bone_heat(union.mesh, skeleton)
    # The plane through the middle of bone d cuts the trunk lengthwise.
    cut = cut_across_bone(union.mesh, skin, skeleton, 3, 0.5)
    assert any("skin" in note for note in cut.notes)
    assert volume(cut.far.mesh) == pytest.approx(np.pi * 0.12**2 * 0.95, rel=0.2)
    assert volume(cut.near.mesh) + volume(cut.far.mesh) == pytest.approx(volume(union.mesh), rel=1e-9)
    for piece in (cut.near, cut.far):
        assert watertight(piece.mesh)
        unchanged(piece, union.mesh, skin)


@pytest.mark.parametrize("flat", [False, True])
def test_caps_can_be_round(flat):
    mesh = tube(around=32, step=0.05)
    mesh = flat_shaded(mesh) if flat else mesh
    skin, surface = random_skin(len(mesh.vertices), 3), PlaneCut([0, 0, 1.02], [0, 0, 1])
    plain = cut_by_stroke(mesh, skin, surface)
    half_balls = cut_by_stroke(mesh, skin, surface, settings=CutSettings(rounding=1.0))
    for flat_cap, round_cap in ((plain.near, half_balls.near), (plain.far, half_balls.far)):
        assert watertight(round_cap.mesh)
        unchanged(round_cap, mesh, skin)
        added = volume(round_cap.mesh) - volume(flat_cap.mesh)
        assert added == pytest.approx(2 / 3 * np.pi * 0.2**3, rel=0.1)
    assert half_balls.near.mesh.bounds[1, 2] == pytest.approx(1.02 + 0.2, abs=0.02)
    assert half_balls.far.mesh.bounds[0, 2] == pytest.approx(1.02 - 0.2, abs=0.02)


def test_impossible_cut_gives_the_reason():
    mesh, skeleton = tube(), line([[1.0, 0, 0], [1.0, 0, 1.0]])
    skin = on_bone(mesh, 0)
    with pytest.raises(InputError, match="surrounds"):
        cut_across_bone(mesh, skin, skeleton, 1, 0.5)
    with pytest.raises(InputError, match="no length"):
        cut_across_bone(mesh, skin, skeleton, 0, 0.5)
    with pytest.raises(InputError, match="does not cross the mesh"):
        cut_by_stroke(mesh, skin, PlaneCut([0, 0, 5.0], [0, 0, 1]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="does not cross the mesh"):
            cut_by_stroke(mesh, skin, StrokeCut([[5.0, 5.0], [6.0, 5.0]], FROM_Z))
    with pytest.raises(InputError, match="single point"):
        StrokeCut([[0, 0], [0, 0]], FROM_Z)
    with pytest.raises(InputError, match="the normal of the cutting plane is 0"):
        PlaneCut([0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="faces"):
        cut_by_stroke(Mesh(mesh.vertices, np.zeros((0, 3))), None, PlaneCut([0, 0, 1], [0, 0, 1]))
    broken = mesh.vertices.copy()
    broken[3] = np.nan
    with pytest.raises(InputError, match="finite"):
        cut_by_stroke(Mesh(broken, mesh.faces), None, PlaneCut([0, 0, 1], [0, 0, 1]))


def test_loops_chains_and_windings():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    assert signed_area(square) == 1 and signed_area(square[::-1]) == -1
    assert winding_number(square, np.array([0.5, 0.5])) == pytest.approx(1)
    assert winding_number(square, np.array([1.5, 0.5])) == pytest.approx(0, abs=1e-9)
    # One pair is reversed, as in a triangle soup with a flipped face.
    (loop, shut), *rest = order_chains(np.array([[0, 1], [1, 2], [3, 2], [3, 0]]))
    assert shut and not rest
    assert list(np.roll(loop, -list(loop).index(0))) == [0, 1, 2, 3]
    open_chains = order_chains(np.array([[0, 1], [1, 2], [5, 6], [6, 7]]))
    assert not any(shut for _, shut in open_chains)
    places = np.array([[0, 0], [1, 0], [2, 0], [9, 9], [9, 9], [2, 0.1], [1, 0.1], [0, 0.1]], float)
    (whole, shut), *rest = join_chains(open_chains, places, 0.3)
    assert shut and not rest and len(whole) == 6
