"""Tests of a polyline's basis: the definition of the paper, degenerate views, and the flip."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.motion.layers.basis import basis_from_views, compute_view_basis
from enliven.rotation import canonical, from_rotation_vector, multiply, rotate

laws = settings(deadline=None, max_examples=80)
vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


def basis_of(first, view, up):
    first, view, up = (vector / np.linalg.norm(vector) for vector in (first, view, up))
    return compute_view_basis(first, view, up)[0]


def axes(q):
    return rotate(q, np.eye(3))


@laws
@given(vectors, vectors, vectors)
def test_basis_matches_the_paper(first, view, up):
    x, y, z = axes(basis_of(first, view, up))
    np.testing.assert_allclose(z, first / np.linalg.norm(first), atol=1e-9)
    np.testing.assert_allclose(np.cross(y, z), x, atol=1e-9)
    unit = view / np.linalg.norm(view)
    assume(np.linalg.norm(np.cross(z, unit)) > 1e-3)
    assert abs(y @ unit) < 1e-9 and abs(y @ z) < 1e-9
    assert y @ up > -1e-9


@laws
@given(vectors, vectors)
def test_a_bone_along_the_view_has_the_y_nearest_to_up(first, up):
    assume(np.linalg.norm(np.cross(first, up)) > 1e-2)
    for view in (first, -first):
        _, y, z = axes(basis_of(first, view, up))
        wanted = up - (up @ z) * z
        np.testing.assert_allclose(y, wanted / np.linalg.norm(wanted), atol=1e-9)


def test_a_bone_along_view_and_up_has_some_basis_that_is_always_the_same():
    up = np.array([0.0, 1.0, 0.0])
    _x, y, z = axes(basis_of(up, up, up))
    np.testing.assert_allclose([y, z], [[1, 0, 0], up], atol=1e-12)


@laws
@given(vectors, vectors, vectors, vectors, vectors, st.booleans())
def test_a_turn_of_both_with_their_view_turns_the_basis(source, target, view, up, by, flip):
    for bone in (source, target):
        assume(np.linalg.norm(np.cross(bone, view)) > 0.05)
    turn = from_rotation_vector(by)
    plain = basis_from_views(source, target, view, up, flip=flip)
    turned = basis_from_views(*(rotate(turn, v) for v in (source, target, view, up)), flip=flip)
    expected = multiply(multiply(turn, plain), turn * [1, -1, -1, -1])
    assume(abs(plain[0]) > 1e-6)
    np.testing.assert_allclose(turned, canonical(expected), atol=1e-7)


@laws
@given(vectors, vectors, vectors)
def test_the_same_bone_needs_no_turn_and_flip_is_half_a_turn_about_it(first, view, up):
    np.testing.assert_allclose(basis_from_views(first, first, view, up), [1, 0, 0, 0], atol=1e-9)
    x = rotate(basis_from_views(first, first, view, up, flip=True), first)
    np.testing.assert_allclose(x, first, atol=1e-9)
    assert abs(basis_from_views(first, first, view, up, flip=True)[0]) < 1e-9


@laws
@given(vectors, vectors, vectors, vectors, st.booleans())
def test_the_first_bone_of_the_source_lands_on_that_of_the_target(source, target, view, up, flip):
    basis = basis_from_views(source, target, view, up, flip=flip)
    turned = rotate(basis, source / np.linalg.norm(source))
    np.testing.assert_allclose(turned, target / np.linalg.norm(target), atol=1e-9)


@pytest.mark.parametrize("tilt", [-0.1, -1e-3, 0.0, 1e-3, 0.1])
def test_hanging_bones_that_lean_to_either_side_are_not_mirrored(tilt):
    # A bend to the right on the screen stays one. A basis from the up direction alone would mirror one of the
    # two.
    source, target = np.array([0.05, -1.0, 0.0]), np.array([tilt, -1.0, 0.0])
    bend = from_rotation_vector([0.0, 0.0, 0.5])
    basis = basis_from_views(source, target)
    turned = multiply(multiply(basis, bend), basis * [1, -1, -1, -1])
    np.testing.assert_allclose(turned, bend, atol=1e-9)


def test_a_bend_upward_of_a_right_arm_is_one_of_a_left_arm():
    basis = basis_from_views([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0])
    bend = from_rotation_vector([0.0, 0.0, 0.5])
    turned = multiply(multiply(basis, bend), basis * [1, -1, -1, -1])
    assert rotate(bend, [1.0, 0, 0])[1] > 0.4 and rotate(turned, [-1.0, 0, 0])[1] > 0.4


def test_zero_direction_is_refused():
    for bad in ([0.0, 0.0, 0.0], [np.nan, 0, 0], [1.0, 0.0]):
        with pytest.raises(InputError, match="not a direction"):
            basis_from_views(bad, [0.0, 0.0, 1.0])
        with pytest.raises(InputError, match="not a direction"):
            basis_from_views([1.0, 0, 0], [1.0, 0, 0], up=bad)
