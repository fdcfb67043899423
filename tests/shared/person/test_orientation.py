"""Tests of quantities derived from orientations, and of mirror symmetry."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.person.orientation import mirror_body
from enliven.rotation import normalized, rotate, to_matrix


def some_body(seed: int) -> Body:
    random = np.random.default_rng(seed)
    return Body(
        3, random.normal(size=(20, 3)), random.random(20), normalized(random.normal(size=(20, 4))),
        random.random(2), 1.7,
    )  # fmt: skip


def a_plane(seed: int):
    random = np.random.default_rng(seed)
    normal = random.normal(size=3)
    return random.normal(size=3), normal / np.linalg.norm(normal)


@given(st.integers(0, 1000), st.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_mirrored_twice_is_the_body_itself(seed, plane):
    body, mirror = some_body(seed), a_plane(plane)
    twice = mirror_body(mirror_body(body, *mirror), *mirror)
    np.testing.assert_allclose(twice.joints, body.joints, atol=1e-12)
    np.testing.assert_allclose(to_matrix(twice.orientations), to_matrix(body.orientations), atol=1e-12)
    np.testing.assert_array_equal(twice.confidence, body.confidence)
    np.testing.assert_array_equal(twice.contacts, body.contacts)
    assert (twice.id, twice.stature) == (body.id, body.stature)


@given(st.integers(0, 1000), st.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_a_mirror_reflects_fronts_and_lengths_and_keeps_rotations_proper(seed, plane):
    body, (point, normal) = some_body(seed), a_plane(plane)
    seen = mirror_body(body, point, normal)
    reflection = np.eye(3) - 2 * np.outer(normal, normal)
    matrices, expected = to_matrix(seen.orientations), to_matrix(body.orientations)
    np.testing.assert_allclose(np.linalg.det(matrices), 1.0, atol=1e-9)
    for joint in Joint:
        name = joint.name
        swap = {"LEFT": "RIGHT", "RIGHT": "LEFT"}.get(name.rpartition("_")[2])
        other = Joint[name.rpartition("_")[0] + "_" + swap] if swap else joint
        np.testing.assert_allclose(
            seen.joints[joint] - point, reflection @ (body.joints[other] - point), atol=1e-9
        )
        np.testing.assert_allclose(matrices[joint][:, 1:], reflection @ expected[other][:, 1:], atol=1e-9)


def test_a_person_who_stands_before_the_mirror_looks_back_out_of_it():
    body = Body(1, np.zeros((20, 3)), np.ones(20), np.tile([1.0, 0, 0, 0], (20, 1)))
    seen = mirror_body(body, [0, 0, 1], [0, 0, 1])
    np.testing.assert_allclose(rotate(seen.orientations[0], [0, 0, 1]), [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(rotate(seen.orientations[0], [0, 1, 0]), [0, 1, 0], atol=1e-12)
    aside = mirror_body(body, [0, 0, 0], [1, 0, 0])
    np.testing.assert_allclose(to_matrix(aside.orientations), to_matrix(body.orientations), atol=1e-12)
