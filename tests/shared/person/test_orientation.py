"""What is read from orientations, and the mirror's laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.person.body import PARENTS, Body, Joint
from enliven.person.orientation import forearm_twist, head_turn, local, mirrored, twist
from enliven.rotation import from_rotation_vector, multiply, normalized, rotate, to_matrix


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
    twice = mirrored(mirrored(body, *mirror), *mirror)
    np.testing.assert_allclose(twice.joints, body.joints, atol=1e-12)
    np.testing.assert_allclose(to_matrix(twice.orientations), to_matrix(body.orientations), atol=1e-12)
    np.testing.assert_array_equal(twice.confidence, body.confidence)
    np.testing.assert_array_equal(twice.contacts, body.contacts)
    assert (twice.id, twice.stature) == (body.id, body.stature)


@given(st.integers(0, 1000), st.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_a_mirror_reflects_fronts_and_lengths_and_keeps_rotations_proper(seed, plane):
    body, (point, normal) = some_body(seed), a_plane(plane)
    seen = mirrored(body, point, normal)
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
    seen = mirrored(body, [0, 0, 1], [0, 0, 1])
    np.testing.assert_allclose(rotate(seen.orientations[0], [0, 0, 1]), [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(rotate(seen.orientations[0], [0, 1, 0]), [0, 1, 0], atol=1e-12)
    aside = mirrored(body, [0, 0, 0], [1, 0, 0])
    np.testing.assert_allclose(to_matrix(aside.orientations), to_matrix(body.orientations), atol=1e-12)


@given(st.floats(-3.1, 3.1), st.floats(-1.2, 1.2))
@settings(max_examples=50, deadline=None)
def test_a_twist_is_what_was_turned_about_the_axis(angle, bend):
    turn = multiply(from_rotation_vector([bend, 0.0, 0.0]), from_rotation_vector([0.0, angle, 0.0]))
    assert twist(turn, [0, 1, 0]) == pytest.approx(angle, abs=1e-9)
    assert twist(-turn, [0, 1, 0]) == pytest.approx(angle, abs=1e-9)


def test_the_head_and_the_forearm_are_read_whatever_the_body_does():
    whole = from_rotation_vector([0.3, 2.0, -0.4])
    orientations = np.tile(whole, (20, 1))
    orientations[Joint.HEAD] = multiply(whole, from_rotation_vector([0.0, 0.5, 0.0]))
    orientations[Joint.HAND_LEFT] = multiply(whole, from_rotation_vector([0.0, -0.7, 0.0]))
    body = Body(1, np.zeros((20, 3)), np.ones(20), orientations)
    assert head_turn(body) == pytest.approx(0.5)
    assert forearm_twist(body, "left") == pytest.approx(-0.7)
    assert forearm_twist(body, "right") == pytest.approx(0.0)
    assert head_turn(Body(1, np.zeros((20, 3)), np.ones(20))) is None
    assert forearm_twist(Body(1, np.zeros((20, 3)), np.ones(20)), "left") is None


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_local_turns_multiply_back_to_the_world(seed):
    world = some_body(seed).orientations
    turns = local(world)
    made = turns.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            made[joint] = multiply(made[parent], turns[joint])
    np.testing.assert_allclose(to_matrix(made), to_matrix(world), atol=1e-9)
