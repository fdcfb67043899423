"""Tests that a tracked person can replace the examples' performer: size, position and facing do not
matter.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.examples.performer import extract_performer_clip
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.person import BODY_NAMES
from enliven.person.body import Body
from enliven.person.joints import MIRROR, PARENTS, Joint
from enliven.possession.placement import rotation_about_y
from enliven_edge.stage.puppet.bones import BoneTracker
from enliven_edge.stage.puppet.retargeting import Retargeting
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

few = settings(max_examples=25, deadline=None)
PAIRED = tuple(BODY_NAMES[j] for j in (Joint.HEAD, Joint.WRIST_LEFT, Joint.ELBOW_RIGHT, Joint.ANKLE_LEFT))
HANDS = ("LeftHand", "RightHand", "Head", "LeftFoot", "RightFoot")


def person(x=0.0, z=-2.5, yaw=0.0, arm=0.4, knee=0.0, height=1.75) -> Body:
    """Returns a person with the left arm forward and the left knee up, by the given angles, radians."""
    turns = standing_pose(yaw, arm_forward=0.1, elbow=0.4)
    turns[model.UPPER_ARM_L] = rotation(x=-arm) @ turns[model.UPPER_ARM_L]
    turns[model.THIGH_L] = rotation(x=-knee) @ turns[model.THIGH_L]
    posture = Posture(np.array([x, 0.57 * height, z]), turns, model.lengths_for_height(height))
    return Body(1, posture.joints(), np.ones(20), stature=height)


def other_skeleton() -> Skeleton:
    """Returns a performer with other bones and joint names, with stretched arms, facing +X at rest."""
    names, parents, at = ["Hips"], [-1], [(0.0, 1.0, 0.0)]

    def add(name: str, parent: str, way: tuple[float, float, float]) -> None:
        number = names.index(parent)
        names.append(name)
        parents.append(number)
        at.append(tuple(np.add(at[number], way)))

    for name, up in (("Spine", 0.12), ("Chest", 0.2), ("Neck", 0.2), ("Head", 0.12), ("HeadEnd", 0.2)):
        add(name, names[-1], (0.0, up, 0.0))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        add(f"{side}Collar", "Chest", (0.04 * sign, 0.12, 0.0))
        add(f"{side}Arm", f"{side}Collar", (0.12 * sign, 0.0, 0.0))
        add(f"{side}ForeArm", f"{side}Arm", (0.30 * sign, 0.0, 0.0))
        add(f"{side}Hand", f"{side}ForeArm", (0.27 * sign, 0.0, 0.0))
        add(f"{side}HandEnd", f"{side}Hand", (0.1 * sign, 0.0, 0.0))
        add(f"{side}UpLeg", "Hips", (0.1 * sign, -0.06, 0.0))
        add(f"{side}Leg", f"{side}UpLeg", (0.0, -0.42, 0.0))
        add(f"{side}Foot", f"{side}Leg", (0.0, -0.42, 0.0))
        add(f"{side}Toe", f"{side}Foot", (0.0, -0.08, 0.14))
    turned = np.array(at) @ rotation_about_y(np.pi / 2).T
    return Skeleton(tuple(names), np.array(parents, np.int32), turned)


OTHER = other_skeleton()


def seen(retargeting: Retargeting, *bodies: Body) -> np.ndarray:
    bones = BoneTracker(0.3)
    for body in bodies:
        pose = retargeting.compute_pose(bones.update(body, 1 / 30))
    return pose


@few
@given(st.floats(-1.0, 2.5), st.floats(0.0, 1.5))
def test_recorded_performer_reproduces_their_own_poses(arm: float, knee: float) -> None:
    bodies = [person(), person(arm=arm, knee=knee)]
    clip = clip_of_bodies(bodies, np.array([0.0, 1.0]), "own", step=1.0)
    retargeting = Retargeting(clip.skeleton, PAIRED)
    np.testing.assert_allclose(
        seen(retargeting, bodies[1]), extract_performer_clip(clip, PAIRED).poses[1], atol=0.02
    )


@few
@given(
    st.floats(1.0, 2.1),
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
    st.floats(-3.1, 3.1),
    st.floats(-1.0, 2.0),
)
def test_size_place_and_facing_do_not_matter(height, x, z, yaw, arm) -> None:
    for skeleton, joints in ((OTHER, HANDS), (own_skeleton(), PAIRED)):
        retargeting = Retargeting(skeleton, joints)
        expected = seen(retargeting, person(arm=arm))
        posed = seen(retargeting, person(x, z, yaw, arm, height=height))
        np.testing.assert_allclose(posed, expected, atol=0.02)


def own_skeleton() -> Skeleton:
    return clip_of_bodies([person()], np.zeros(1), "own").skeleton


def test_other_bones_go_where_the_persons_go() -> None:
    retargeting = Retargeting(OTHER, HANDS)
    # The examples' performer faces +X at rest, so ahead is +X and left is -Z.
    straight = person(arm=np.pi / 2 - 0.1)
    straight.joints[[Joint.WRIST_LEFT, Joint.HAND_LEFT]] = straight.joints[Joint.SHOULDER_LEFT] + np.outer(
        [0.54, 0.64], [0.0, 0.0, 1.0]
    )
    straight.joints[Joint.ELBOW_LEFT] = straight.joints[Joint.SHOULDER_LEFT] + [0.0, 0.0, 0.3]
    pose = seen(retargeting, straight)
    shoulder = OTHER.positions[OTHER.index("LeftArm")] - OTHER.positions[0]
    np.testing.assert_allclose(pose[0], shoulder + np.array([0.57, 0.0, 0.0]), atol=0.06)
    hanging = pose[1] - (OTHER.positions[OTHER.index("RightArm")] - OTHER.positions[0])
    assert hanging[1] < -0.45
    assert pose[2][1] > 0.6
    assert retargeting.joints == (
        Joint.WRIST_LEFT, Joint.WRIST_RIGHT, Joint.HEAD, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT
    )  # fmt: skip


def test_a_joint_that_is_not_seen_keeps_its_direction_and_comes_back_softly() -> None:
    retargeting = Retargeting(own_skeleton(), PAIRED)
    bones = BoneTracker(0.3)
    before = retargeting.compute_pose(bones.update(person(arm=1.5), 0.0))
    lost = person(arm=1.5, yaw=1.0, x=2.0)
    lost.joints[Joint.WRIST_LEFT] = (9.0, 9.0, 9.0)
    lost.confidence[Joint.WRIST_LEFT] = 0.0
    np.testing.assert_allclose(retargeting.compute_pose(bones.update(lost, 1 / 30)), before, atol=1e-6)
    lost.joints[Joint.WRIST_LEFT] = np.nan
    np.testing.assert_allclose(retargeting.compute_pose(bones.update(lost, 1 / 30)), before, atol=1e-6)
    back = person(arm=-0.5)
    steps = [retargeting.compute_pose(bones.update(back, 1 / 30))[1] for _ in range(30)]
    forearm = np.linalg.norm(np.diff([before[1], *steps], axis=0), axis=1)
    assert 0.0 < forearm[0] < 0.6
    np.testing.assert_allclose(steps[-1], seen(retargeting, back)[1], atol=1e-6)


def test_never_tracked_performer_stands_with_hanging_arms() -> None:
    retargeting = Retargeting(own_skeleton(), PAIRED)
    nobody = Body(1, np.full((20, 3), np.nan), np.zeros(20))
    pose = seen(retargeting, nobody)
    assert np.isfinite(pose).all()
    assert pose[0, 1] > 0.4
    assert pose[1, 1] < 0.1
    assert pose[3, 1] < -0.6


def test_repeated_turns_give_a_continuous_yaw() -> None:
    bones = BoneTracker(0.3)
    yaws = [bones.update(person(yaw=yaw), 1 / 30).yaw for yaw in np.linspace(0.0, 4 * np.pi, 90)]
    np.testing.assert_allclose(np.diff(yaws), 4 * np.pi / 89, atol=0.02)


def test_facing_comes_from_the_chest_if_legs_are_hidden() -> None:
    near = person(yaw=0.8)
    for joint in Joint:
        if joint.name.split("_")[0] in ("HIP", "KNEE", "ANKLE", "FOOT"):
            near.confidence[joint] = 0.0 if joint is not Joint.HIP_CENTER else 1.0
    assert BoneTracker(0.3).update(near, 0.0).yaw == pytest.approx(0.8, abs=0.02)


def test_unmappable_joints_are_reported_by_name() -> None:
    with pytest.raises(InputError, match="'Tentacle'"):
        Retargeting(OTHER, ("LeftHand", "Tentacle"))
    tail = Skeleton(
        (*OTHER.names, "Tail1", "Tail2"),
        np.array([*OTHER.parents, 0, len(OTHER)], np.int32),
        np.vstack([OTHER.positions, [(-0.5, 0.9, 0.0), (-1.1, 0.8, 0.0)]]),
    )
    with pytest.raises(InputError, match="no joint similar to 'Tail2'"):
        Retargeting(tail, ("LeftHand", "Tail2"))


def test_the_mirror_of_a_pose_is_the_pose_of_the_mirror() -> None:
    joints = tuple(BODY_NAMES)
    retargeting = Retargeting(own_skeleton(), joints)
    body = person(arm=1.2, knee=0.7)
    turned = Body(1, body.joints[list(MIRROR)] * [-1.0, 1.0, 1.0], np.ones(20))
    posed, other = seen(retargeting, body), seen(retargeting, turned)
    np.testing.assert_allclose(other[list(MIRROR)] * [-1.0, 1.0, 1.0], posed, atol=0.01)
    assert len(PARENTS) == len(posed)
