"""Tests of the humanoid bones of performers and rigged characters with any rest pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_bodies import horse, man
from made_people import CONVENTIONS, convention_name, person
from posed_people import create_pose, facing_away, performer, some_turns

from enliven.document.skeleton import Skeleton
from enliven.outputs.humanoid_map import humanoid_map
from enliven.person.human_pose import human_of_body, orientations_of_joints
from enliven.person.joints import Joint
from enliven.rotation import IDENTITY, from_rotation_vector, multiply, rotate, unit

T_POSE = {"Left": np.array([1.0, 0, 0]), "Right": np.array([-1.0, 0, 0])}
LIMBS = [("UpperArm", "shoulder", "elbow"), ("LowerArm", "elbow", "wrist"), ("UpperLeg", "hip", "knee"),
         ("LowerLeg", "knee", "ankle")]  # fmt: skip
"""Humanoid bone, and the joints of :func:`made_bodies.man` at its ends."""


def t_direction(side: str, bone: str) -> np.ndarray:
    return T_POSE[side] if "Arm" in bone else np.array([0.0, -1.0, 0.0])


def test_bones_of_a_performer_point_along_its_limbs():
    body = performer()
    human = human_of_body(body, "performer-1")
    for side in ("LEFT", "RIGHT"):
        for bone, begins, ends in (
            ("UpperArm", "SHOULDER", "ELBOW"),
            ("LowerArm", "ELBOW", "WRIST"),
            ("UpperLeg", "HIP", "KNEE"),
            ("LowerLeg", "KNEE", "ANKLE"),
        ):
            place, turn = human.get_bone(f"{side.title()}{bone}")
            begin, end = body.joints[Joint[f"{begins}_{side}"]], body.joints[Joint[f"{ends}_{side}"]]
            assert np.allclose(place, begin)
            assert np.allclose(rotate(turn, t_direction(side.title(), bone)), unit(end - begin), atol=1e-6)


def test_palms_face_down_in_the_t_pose():
    body = performer()
    human = human_of_body(body, "performer-1")
    # The palm of a hanging left hand faces the thigh, the bone's -X. With the arm held out, it faces down.
    inwards = rotate(body.orientations[Joint.WRIST_LEFT], [-1.0, 0.0, 0.0])
    assert np.allclose(rotate(human.get_bone("LeftLowerArm")[1], [0.0, -1.0, 0.0]), inwards, atol=1e-9)


def test_local_rotations_and_positions_compose_to_the_world():
    human = human_of_body(performer(), "performer-1")
    positions, turns = human.local()
    world_positions, world_turns = positions.copy(), turns.copy()
    for bone, parent in enumerate(human.parents):
        if parent >= 0:
            world_turns[bone] = multiply(world_turns[parent], turns[bone])
            world_positions[bone] = world_positions[parent] + rotate(world_turns[parent], positions[bone])
    assert np.allclose(world_positions, human.positions) and np.allclose(world_turns, human.turns)


def test_orientations_from_joints_agree_with_measured_ones():
    body = performer()
    turns = orientations_of_joints(body.joints)
    for joint in (
        Joint.HIP_CENTER,
        Joint.SHOULDER_CENTER,
        Joint.ELBOW_LEFT,
        Joint.KNEE_LEFT,
        Joint.ANKLE_RIGHT,
    ):
        for axis in ([0, 1, 0], [0, 0, 1]):
            cosine = rotate(turns[joint], axis) @ rotate(body.orientations[joint], axis)
            assert cosine > 0.8, (joint, axis)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_rig_at_rest_with_a_t_pose_has_no_rotations(convention):
    skeleton = person(convention)
    mapped = humanoid_map(skeleton)
    human = mapped.convert_pose(create_pose("x", skeleton, np.tile(IDENTITY, (len(skeleton), 1)))[0])
    assert {"Hips", "Spine", "Head", "LeftUpperArm", "RightHand", "LeftFoot"} <= set(human.bones)
    for bone in ("Hips", "Spine", "Head", "LeftFoot", "RightFoot"):
        assert np.allclose(np.abs(human.get_bone(bone)[1]), IDENTITY), bone
    angle = 2 * np.arccos(np.clip(np.abs(human.turns[:, 0]), 0, 1))
    assert np.degrees(angle).max() < 10, "made people have slightly bent limbs"


@pytest.mark.slow
@given(st.integers(0, 1000), st.sampled_from(sorted(CONVENTIONS)), st.booleans())
def test_bones_of_a_rig_point_along_its_limbs(seed, convention, away):
    random = np.random.default_rng(seed)
    skeleton = person(convention, random, extras=bool(seed % 2))
    if away:
        skeleton = facing_away(skeleton)
    mapped = humanoid_map(skeleton)
    pose, joints = create_pose("x", skeleton, some_turns(len(skeleton), seed), random.uniform(-2, 2, 3))
    human = mapped.convert_pose(pose)
    for side in ("Left", "Right"):
        for bone, begins, ends in LIMBS:
            begin, end = (
                joints[skeleton.index(convention_name(convention, f"{side} {j}"))] for j in (begins, ends)
            )
            place, turn = human.get_bone(f"{side}{bone}")
            assert np.allclose(place, begin, atol=1e-5)
            assert np.allclose(rotate(turn, t_direction(side, bone)), unit(end - begin), atol=1e-4)


@pytest.mark.parametrize("away", [False, True], ids=["VRM 1 faces +Z", "VRM 0 faces -Z"])
def test_the_front_of_the_rest_pose_does_not_matter(away):
    skeleton = facing_away(man()) if away else man()
    # The rig is rotated to face +X, whatever direction its rest pose faces.
    quarter = from_rotation_vector([0.0, -np.pi / 2 if away else np.pi / 2, 0.0])
    turns = np.tile(IDENTITY, (len(skeleton), 1))
    turns[0] = quarter
    human = humanoid_map(skeleton).convert_pose(create_pose("x", skeleton, turns)[0])
    assert np.allclose(rotate(human.get_bone("Hips")[1], [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0], atol=1e-6)
    # Facing +X, the left is at -Z.
    assert human.get_bone("LeftUpperArm")[0][2] < -0.1 < 0.1 < human.get_bone("RightUpperArm")[0][2]


def test_an_animal_is_not_a_humanoid():
    assert humanoid_map(horse()) is None
    assert humanoid_map(man(named=False)) is None


def test_fingers_get_the_names_of_the_humanoid():
    names, plain = ("leftIndexProximal", "leftIndexIntermediate", "leftIndexDistal"), person("vrm")
    count, wrist = len(plain), plain.index("leftHand")
    ends = plain.positions[wrist] + np.array([[0.08, 0, 0.03], [0.12, 0, 0.03], [0.15, 0, 0.03]])
    parents = np.array([*plain.parents, wrist, count, count + 1])
    skeleton = Skeleton((*plain.names, *names), parents, np.concatenate([plain.positions, ends]))
    bones = humanoid_map(skeleton).bones
    assert set(bones) >= {"LeftIndexProximal", "LeftIndexIntermediate", "LeftIndexDistal"}
