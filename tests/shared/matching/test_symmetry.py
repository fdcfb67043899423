"""Tests of finding equal limbs, which are rotated about an axis or mirrored."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.skeleton import Skeleton
from enliven.matching.symmetry import SymmetrySettings, find_equal_limbs
from enliven.rotation import from_rotation_vector, to_matrix

LIMB = np.array([[0.3, 0.0, 0.0], [0.6, 0.1, 0.2], [0.9, -0.2, 0.5]])


class SkeletonBuilder:
    """A skeleton to which limbs are added. The first joint is the body."""

    def __init__(self, middle=(0.0, 1.0, 0.0)):
        self.points, self.parents = [np.array(middle)], [-1]

    def limb(self, points, start=0):
        """Adds a chain of joints below ``start``, at offsets from the body. Returns the number of the first
        joint.
        """
        first = len(self.points)
        for i, point in enumerate(points):
            self.parents.append(start if i == 0 else len(self.points) - 1)
            self.points.append(self.points[0] + point)
        return first

    @property
    def skeleton(self):
        names = tuple(f"j{i}" for i in range(len(self.points)))
        return Skeleton(names, np.array(self.parents), np.array(self.points))


def turned(points, degrees, axis=(0.0, 1.0, 0.0)):
    return points @ to_matrix(from_rotation_vector(np.radians(degrees) * np.array(axis))).T


def squid(arms=8, noise=0.0):
    """Returns a mantle with arms around it below. Each arm is twisted, so that no mirror maps one arm to
    another.
    """
    rng = np.random.default_rng(3)
    body = SkeletonBuilder()
    body.limb(np.array([[0.0, 0.5, 0.0], [0.0, 1.0, 0.0]]))
    for i in rng.permutation(arms):
        body.limb(turned(LIMB, 360 * i / arms) + noise * rng.normal(size=LIMB.shape))
    return body.skeleton


def test_the_arms_of_a_squid_are_one_group():
    skeleton = squid()
    (group,) = find_equal_limbs(skeleton)
    assert (group.kind, group.joint, len(group.limbs)) == ("rotation", 0, 8)
    np.testing.assert_allclose(np.abs(group.axis), [0, 1, 0], atol=1e-9)
    angles = [np.arctan2(limb.linear[0, 2], limb.linear[0, 0]) % (2 * np.pi) for limb in group.limbs]
    np.testing.assert_allclose(
        np.diff(angles), np.pi / 4, atol=1e-9, err_msg="one after the other, all round"
    )


def assert_puts_one_on_another(skeleton, group, atol):
    centre = skeleton.positions[group.joint]
    for a in range(len(group.limbs)):
        for b in range(len(group.limbs)):
            linear = group.get_map(a, b)
            np.testing.assert_allclose(linear @ linear.T, np.eye(3), atol=1e-9)
            for start, end in group.joint_map(a, b).items():
                moved = centre + linear @ (skeleton.positions[start] - centre)
                np.testing.assert_allclose(moved, skeleton.positions[end], atol=atol)


@given(st.integers(2, 9), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_whatever_the_skeletons_place_and_size(arms, seed):
    rng = np.random.default_rng(seed)
    before = squid(arms)
    scale, turn = rng.uniform(0.01, 100), to_matrix(from_rotation_vector(rng.normal(size=3)))
    skeleton = Skeleton(before.names, before.parents, scale * before.positions @ turn.T + rng.normal(size=3))
    groups = find_equal_limbs(skeleton)
    assert [len(group.limbs) for group in groups] == [arms]
    assert_puts_one_on_another(skeleton, groups[0], 1e-6 * scale)
    if arms > 2:
        assert abs(groups[0].axis @ turn[:, 1]) == pytest.approx(1.0)


def test_an_unsteady_hand_is_forgiven_as_far_as_the_settings_say():
    skeleton = squid(noise=0.01)
    (group,) = find_equal_limbs(skeleton)
    assert len(group.limbs) == 8
    assert max(limb.error for limb in group.limbs) < 0.08
    assert_puts_one_on_another(skeleton, group, 0.1)
    assert not [g for g in find_equal_limbs(skeleton, SymmetrySettings(tolerance=0.002)) if len(g.limbs) == 8]


def person():
    """Returns hips with legs, a spine, arms with two fingers each, and a head that is left of the middle."""
    body = SkeletonBuilder()
    mirror = np.array([-1.0, 1.0, 1.0])
    spine = body.limb(np.array([[0.0, 0.3, 0.0], [0.0, 0.5, 0.02]])) + 1
    body.limb(np.array([[0.03, 0.7, 0.05]]), spine)
    arm = np.array([[0.2, 0.5, 0.0], [0.5, 0.45, -0.02], [0.75, 0.5, 0.1]])
    leg = np.array([[0.1, -0.1, 0.0], [0.12, -0.5, 0.03], [0.12, -0.9, 0.0], [0.13, -0.92, 0.15]])
    for side in (1.0, mirror):
        wrist = body.limb(arm * side, spine) + 2
        body.limb(np.array([[0.8, 0.55, 0.12]]) * side, wrist)
        body.limb(np.array([[0.8, 0.45, 0.16]]) * side, wrist)
        body.limb(leg * side)
    return body.skeleton


def test_left_and_right_of_a_person():
    skeleton = person()
    groups = [group for group in find_equal_limbs(skeleton) if group.kind == "mirror"]
    assert [(group.joint, len(group.limbs[0].joints)) for group in groups[:2]] == [(0, 4), (2, 5)]
    for group in groups[:2]:
        np.testing.assert_allclose(group.axis, [1, 0, 0], atol=1e-9)
        assert np.linalg.det(group.limbs[1].linear) == pytest.approx(-1.0)
        assert_puts_one_on_another(skeleton, group, 1e-9)
    assert len(groups) == 2, "two fingers that lie askew are no pair of anything"


def test_the_legs_of_a_table_are_turned_and_mirrored():
    body = SkeletonBuilder()
    for x, z in ((0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)):
        body.limb(np.array([[x, 0.0, z], [x, -0.7, z]]))
    kinds = [(group.kind, len(group.limbs)) for group in find_equal_limbs(body.skeleton)]
    assert kinds == [("rotation", 4), ("mirror", 2), ("mirror", 2)]


def test_two_arms_longer_than_the_others_are_a_group_of_their_own():
    body = SkeletonBuilder()
    for i in range(6):
        body.limb(turned(LIMB, 60 * i))
    for degrees in (30, 210):
        body.limb(turned(1.6 * LIMB, degrees))
    sizes = sorted(len(group.limbs) for group in find_equal_limbs(body.skeleton))
    assert sizes == [2, 6]


def test_six_limbs_of_which_one_is_bent_the_other_way():
    body = SkeletonBuilder()
    for i in range(5):
        body.limb(turned(LIMB, 60 * i))
    body.limb(turned(LIMB * [1, -1, -1], 300))
    assert max(len(group.limbs) for group in find_equal_limbs(body.skeleton)) == 5


def test_a_skeleton_without_equal_limbs_has_none():
    body = SkeletonBuilder()
    body.limb(LIMB)
    body.limb(2 * LIMB)
    assert find_equal_limbs(body.skeleton) == ()
    assert find_equal_limbs(Skeleton(("one",), np.array([-1]), np.zeros((1, 3)))) == ()


def test_limbs_in_one_place_are_no_pair():
    body = SkeletonBuilder()
    body.limb(LIMB)
    body.limb(LIMB)
    assert [g for g in find_equal_limbs(body.skeleton) if g.kind == "mirror"] == []
