"""Tests that seam smoothing is local: creases are rounded, smooth or distant parts are unchanged, weights
stay valid.
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
    same_bits,
    tube,
    volume,
    watertight,
)
from scipy.spatial import cKDTree

from enliven.document.skeleton import Skeleton
from enliven.meshes.mesh import Mesh
from enliven.modeling.mesh.mesh_cut import cut_across_bone
from enliven.modeling.mesh.mesh_union import unite_meshes
from enliven.modeling.mesh.seam import SeamSettings, fair_surface, heal_seam, reweight_seam, smooth_seam


def tee(flat=False):
    """Returns two tubes that meet at right angles, and their skeleton."""
    trunk, branch = tube(0.3, 2.0, 20, 0.09), tube(0.2, 1.2, 16, 0.08)
    turned = branch.vertices @ np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]]).T
    branch = Mesh(turned + np.array([0.05, 0.01, 1.0]), branch.faces, "branch")
    if flat:
        trunk, branch = flat_shaded(trunk), flat_shaded(branch)
    skeleton = Skeleton(
        ("a", "b", "c", "d"),
        np.array([-1, 0, 1, 1]),
        np.array([[0, 0, 0], [0, 0, 1.0], [0, 0, 2], [1.2, 0, 1]]),
    )
    union = unite_meshes(trunk, on_bone(trunk, 1), branch, on_bone(branch, 3), tidy=True)
    return union, skeleton, volume(trunk), volume(branch)


def sharpest(mesh, near):
    """Returns the largest angle in degrees between faces at an edge whose vertices are both ``near``."""
    normals, seen, worst = mesh.face_normals(), {}, 0.0
    for f, face in enumerate(mesh.faces.tolist()):
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            key = (min(a, b), max(a, b))
            if key in seen and near[a] and near[b]:
                cosine = np.clip(normals[f] @ normals[seen[key]], -1, 1)
                worst = max(worst, float(np.degrees(np.arccos(cosine))))
            seen[key] = f
    return worst


@pytest.mark.parametrize("flat", [False, True])
def test_only_the_seam_is_smoothed(flat):
    union, skeleton, *parts = tee(flat)
    mesh, skin = heal_seam(union.mesh, union.skin, skeleton, union.seam)
    assert watertight(mesh) and partition_of_unity(skin)
    assert max(parts) < volume(mesh) < sum(parts)
    # A fillet fills the crease. It removes no volume and adds little.
    assert volume(union.mesh) <= volume(mesh) < 1.05 * volume(union.mesh)
    away, _ = cKDTree(union.mesh.vertices[union.seam]).query(union.mesh.vertices)
    far = away > 0.5
    assert far.sum() > 200
    assert same_bits(mesh.vertices[far], union.mesh.vertices[far])
    assert same_bits(skin.weights[far], union.skin.weights[far])
    assert same_bits(skin.indices[far], union.skin.indices[far])
    assert same_bits(mesh.faces, union.mesh.faces)
    assert not same_bits(skin.weights, union.skin.weights)


def test_a_crease_becomes_a_fillet():
    union, *_ = tee()
    before = sharpest(union.mesh, union.seam)
    after = sharpest(smooth_seam(union.mesh, union.seam), union.seam)
    assert before > 80 and after < 0.7 * before


def test_weights_run_smoothly_over_the_seam():
    union, skeleton, *_ = tee()
    skin = reweight_seam(union.mesh, union.skin, skeleton, union.seam)
    edges = union.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)

    def leap(skin):
        of_branch = np.where(skin.indices == 3, skin.weights, 0).sum(1)
        return np.abs(np.diff(of_branch[edges], axis=1)).max()

    assert leap(union.skin) > 0.6 and leap(skin) < 0.5


@settings(max_examples=10, deadline=None)
@given(u=st.floats(0.2, 0.8), around=st.integers(8, 24))
def test_cut_and_merge_restore_the_mesh(u, around):
    mesh, skeleton = tube(0.3, 2.0, around), line([[0, 0, 0], [0, 0, 2.0]])
    cut = cut_across_bone(mesh, on_bone(mesh, 1), skeleton, 1, u)
    union = unite_meshes(cut.near.mesh, cut.near.skin, cut.far.mesh, cut.far.skin)
    smooth = smooth_seam(union.mesh, union.seam)
    assert same_bits(smooth.vertices, union.mesh.vertices)


def test_fairing_continues_surrounding_surface():
    """A dented tube becomes a tube again, and a dented plane a plane."""
    for mesh, most in ((tube(0.3, 2.0, 24, 0.08), 0.01), (ball(0.3, detail=4), 0.01)):
        free = np.abs(mesh.vertices[:, 2] - mesh.vertices[:, 2].mean()) < 0.17
        dented = mesh.vertices.copy()
        dented[free, :2] *= 0.9 + 0.05 * np.random.default_rng(1).random((free.sum(), 1))
        fair_mesh = fair_surface(Mesh(dented, mesh.faces), free)
        assert same_bits(fair_mesh[~free], dented[~free])
        before = np.linalg.norm(dented[free] - mesh.vertices[free], axis=1).max()
        assert before > 0.02
        assert np.abs(np.linalg.norm(fair_mesh[free, :2], axis=1) - np.linalg.norm(mesh.vertices[free, :2], axis=1)).max() < most  # fmt: skip  # noqa: E501
    grid = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0), [0.0]), -1).reshape(-1, 3)
    cells = [[12 * i + j, 12 * i + j + 1, 12 * i + j + 13] for i in range(11) for j in range(11)]
    cells += [[12 * i + j, 12 * i + j + 13, 12 * i + j + 12] for i in range(11) for j in range(11)]
    free = (np.abs(grid[:, :2] - 5.5) < 2).all(1)
    bumpy = grid + np.where(free[:, None], [0, 0, 1.0], 0)
    np.testing.assert_allclose(fair_surface(Mesh(bumpy, np.array(cells)), free)[:, 2], 0, atol=1e-3)


@settings(max_examples=20, deadline=None)
@given(detail=st.integers(0, 2), flat=st.booleans(), far=st.floats(0.07, 0.14), size=st.floats(0.02, 0.09))
def test_coarse_meshes_are_not_blown_up(detail, flat, far, size):
    """Where rings reach around a whole mesh, what is free is held; a small shell stays where it is."""
    first, second = ball(0.1, detail=detail), ball(size, (far, 0.011, 0.013), detail=1, name="other")
    if flat:
        first, second = flat_shaded(first), flat_shaded(second)
    union = unite_meshes(first, on_bone(first, 0), second, on_bone(second, 0), tidy=True)
    if not union.fused:
        return
    smooth = smooth_seam(union.mesh, union.seam)
    assert watertight(smooth)
    low, high = union.mesh.bounds
    assert (smooth.vertices > low - 0.05).all() and (smooth.vertices < high + 0.05).all()
    assert 0.6 < volume(smooth) / volume(union.mesh) < 1.4


def test_zero_settings_change_nothing():
    union, skeleton, *_ = tee()
    off = SeamSettings(strength=0.0, weight_rings=0, weight_reach=0.0)
    mesh = smooth_seam(union.mesh, union.seam, off)
    assert mesh is union.mesh
    nowhere = np.zeros_like(union.seam)
    assert reweight_seam(mesh, union.skin, skeleton, nowhere) is union.skin
    assert smooth_seam(mesh, nowhere) is mesh
