"""Tests of combining joints from depth and colour."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.landmarks.colour_pose import fuse_bodies, fuse_people

ASIDE = np.array([1.0, 0.0, 0.0])


def body(seed: int, identity: int = 1, spread: float = 0.02) -> Body:
    random = np.random.default_rng(seed)
    base = np.random.default_rng(99).normal(size=(20, 3))
    return Body(identity, base + random.normal(0, spread, (20, 3)), random.random(20))


seeds = st.integers(0, 1000)


@given(seeds, seeds)
@settings(max_examples=50)
def test_colour_without_confidence_changes_nothing(a, b):
    depth, colour = body(a), dataclasses.replace(body(b, spread=1.0), confidence=np.zeros(20))
    joined = fuse_bodies(depth, colour)
    np.testing.assert_array_equal(joined.joints, depth.joints)
    assert (joined.confidence <= depth.confidence + 1e-12).all()


@given(seeds)
@settings(max_examples=50)
def test_agreeing_sources_increase_confidence(a):
    depth = body(a)
    joined = fuse_bodies(depth, dataclasses.replace(depth, id=5))
    np.testing.assert_allclose(joined.joints, depth.joints)
    assert (joined.confidence >= depth.confidence - 1e-12).all() and joined.id == depth.id


@given(seeds, seeds, st.floats(0.0, 2.0))
@settings(max_examples=50)
def test_a_joint_is_between_both_and_its_confidence_a_probability(a, b, spread):
    depth, colour = body(a), body(b, spread=spread)
    joined = fuse_bodies(depth, colour)
    distance = np.linalg.norm(colour.joints - depth.joints, axis=1)
    parts = [np.linalg.norm(joined.joints - each.joints, axis=1) for each in (depth, colour)]
    np.testing.assert_allclose(parts[0] + parts[1], distance, atol=1e-9)
    assert joined.confidence.min() >= 0.0 and joined.confidence.max() <= 1.0


def test_contradicting_sources_give_surer_one_with_less_confidence():
    depth = body(0)
    far = depth.joints + 0.6 * ASIDE
    sure, unsure = np.full(20, 0.9), np.full(20, 0.3)
    by_depth = fuse_bodies(dataclasses.replace(depth, confidence=sure), Body(2, far, unsure))
    by_colour = fuse_bodies(dataclasses.replace(depth, confidence=unsure), Body(2, far, sure))
    np.testing.assert_allclose(by_depth.joints, depth.joints, atol=1e-3)
    np.testing.assert_allclose(by_colour.joints, far, atol=1e-3)
    assert by_depth.confidence.max() < 0.9 and by_colour.confidence.max() < 0.9


def test_depth_and_colour_people_are_merged_without_new_ones():
    ada, bob = body(0, 1), dataclasses.replace(body(1, 2), joints=body(1).joints + 2.0 * ASIDE)
    for each in (ada, bob):
        each.confidence[[Joint.HIP_CENTER, Joint.HEAD]] = 0.8
    stranger = dataclasses.replace(bob, joints=bob.joints + 3.0 * ASIDE)
    people = fuse_people([ada, bob], [stranger, bob, ada])
    assert [b.id for b in people] == [1, 2]
    for joined, own in zip(people, (ada, bob), strict=True):
        np.testing.assert_allclose(joined.joints, own.joints)
        assert joined.confidence.mean() > own.confidence.mean()
    assert fuse_people([], [ada]) == []
    assert fuse_people([ada], []) == [ada]
