"""Tests of motion captures on a performer: limb directions are kept, soles stay on the floor, any joint
names.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.formats.motion.capture import Capture
from enliven.motion_clips.capture_roles import find_roles
from enliven.person.joints import Joint
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.motion.exercises import get_exercise
from enliven_synthesis.motion.mocap import CapturedMotion

# Joint names in this order: hips, spine, chest, neck, head, then collar, shoulder, elbow, wrist, hand, hip,
# knee, ankle, toe.
CONVENTIONS = {
    "cmu": ("Hips", "LowerBack", "Spine", "Neck", "Head", "{Side}Shoulder", "{Side}Arm", "{Side}ForeArm",
            "{Side}Hand", "{Side}FingerBase", "{Side}UpLeg", "{Side}Leg", "{Side}Foot", "{Side}ToeBase"),
    "namco": ("Hips", "Spine", "Chest", "Neck", "Head", "Shoulder_{S}", "UpperArm_{S}", "LowerArm_{S}",
              "Hand_{S}", "Finger_{S}", "UpperLeg_{S}", "LowerLeg_{S}", "Foot_{S}", "Toes_{S}"),
    "plain": ("Hips", "Ab", "Chest", "Neck", "Head", "{Side}Collar", "{Side}Shoulder", "{Side}Elbow",
              "{Side}Wrist", "{Side}Tip", "{Side}Hip", "{Side}Knee", "{Side}Ankle", "{Side}Toes"),
    "short": ("hip", "abdomen", "chest", "neck", "head", "{s}collar", "{s}shoulder", "{s}elbow",
              "{s}hand", "metacarpal1.{s}", "{s}hip", "{s}knee", "{s}foot", "toe1-1.{s}"),
    "prefixed": ("mixamorig:Hips", "mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Neck", "mixamorig:Head",
                 "mixamorig:{Side}Shoulder", "mixamorig:{Side}Arm", "mixamorig:{Side}ForeArm",
                 "mixamorig:{Side}Hand", "mixamorig:{Side}HandIndex1", "mixamorig:{Side}UpLeg",
                 "mixamorig:{Side}Leg", "mixamorig:{Side}Foot", "mixamorig:{Side}ToeBase"),
}  # fmt: skip
TRUNK = (
    (None, Joint.HIP_CENTER),
    (0, Joint.SPINE),
    (1, Joint.SHOULDER_CENTER),
    (2, Joint.SHOULDER_CENTER),
    (3, Joint.HEAD),
)
LIMBS = (
    (2, Joint.SHOULDER_CENTER), (5, Joint.SHOULDER_LEFT), (6, Joint.ELBOW_LEFT), (7, Joint.WRIST_LEFT),
    (8, Joint.HAND_LEFT), (0, Joint.HIP_LEFT), (10, Joint.KNEE_LEFT), (11, Joint.ANKLE_LEFT),
    (12, Joint.FOOT_LEFT),
)  # fmt: skip
STEP = 1.0 / 60.0


def captured_from(
    name: str, convention: str, unit: float = 1.0, yaw: float = 0.0, build: Proportions | None = None
) -> tuple[Capture, np.ndarray]:
    """Returns a performer's motion as a capture with another convention, unit and heading, and its (F, 20, 3)
    joints.
    """
    performer = Performer(build)
    moves = get_exercise(name) if name != "chair" else get_choreography(name)
    figures = [performer.pose(moves.posture(t)) for t in np.arange(0, min(moves.duration, 6.0), STEP)]
    joints = np.stack([f.joints for f in figures])
    heads = np.stack([f.frames[3, :, :3] for f in figures])
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    words = CONVENTIONS[convention]
    names, parents, sources = [], [], []
    for n, (parent, joint) in enumerate(TRUNK):
        names.append(words[n])
        parents.append(-1 if parent is None else parent)
        sources.append(joint)
    for side in ("left", "right"):
        first = len(names)
        for k, (parent, joint) in enumerate(LIMBS):
            names.append(words[5 + k].format(Side=side.title(), S=side[0].upper(), s=side[0]))
            parents.append(parent if parent < 5 else first + parent - 5)
            sources.append(Joint[joint.name.replace("LEFT", side.upper())])
    positions = joints[:, sources] @ turn.T / unit
    rotations = np.broadcast_to(np.eye(3), (*positions.shape[:2], 3, 3)).copy()
    rotations[:, 4] = turn @ heads
    return Capture(tuple(names), tuple(parents), positions, rotations, STEP), joints


def directions(joints: np.ndarray) -> np.ndarray:
    """Returns (F, 8, 3) unit vectors along arms and legs."""
    pairs = [(4, 5), (5, 6), (8, 9), (9, 10), (12, 13), (13, 14), (16, 17), (17, 18)]
    v = np.stack([joints[:, b] - joints[:, a] for a, b in pairs], 1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from(list(CONVENTIONS)),
    st.sampled_from(["kneel", "overhead", "one leg", "chair"]),
    st.sampled_from([1.0, 0.01, 0.0564]),
    st.floats(-3.1, 3.1),
    st.floats(1.3, 1.95),
    st.floats(0.9, 1.1),
)
def test_limbs_point_where_the_captured_ones_did(convention, name, unit, yaw, height, arms) -> None:
    capture, joints = captured_from(name, convention, unit, yaw)
    motion = CapturedMotion(Performer(Proportions(height, arms=arms)), capture)
    some = range(0, capture.frames, 7)
    danced, joints = np.stack([motion.figure(n * STEP).joints for n in some]), joints[some]
    # Both begin facing +Z, since the capture's heading is removed.
    np.testing.assert_allclose(directions(danced), directions(joints), atol=0.03)


@pytest.mark.parametrize("convention", list(CONVENTIONS))
def test_every_convention_has_its_roles(convention: str) -> None:
    capture, _ = captured_from("overhead", convention)
    roles = find_roles(capture)
    words = CONVENTIONS[convention]
    for at, index in (
        ("elbows", 7),
        ("wrists", 8),
        ("hips", 10),
        ("knees", 11),
        ("ankles", 12),
        ("toes", 13),
    ):
        joint_names = [capture.names[j] for j in getattr(roles, at)]
        assert joint_names == [words[index].format(Side=w, S=w[0], s=w[0].lower()) for w in ("Left", "Right")]
    assert capture.names[roles.root] == words[0]
    assert capture.names[roles.head] == words[4]


@pytest.mark.parametrize("height", [1.3, 1.75, 1.95])
def test_soles_are_on_the_floor_and_steps_are_in_proportion(height: float) -> None:
    capture, joints = captured_from("stroll", "cmu", 0.0564)
    performer = Performer(Proportions(height))
    motion = CapturedMotion(performer, capture)
    figures = [motion.figure(n * STEP) for n in range(capture.frames)]
    lowest = np.array([performer.soles(f).min() for f in figures])
    assert np.abs(lowest).max() < 0.025
    walked = np.linalg.norm(figures[-1].joints[0] - figures[0].joints[0])
    captured = np.linalg.norm(joints[-1, 0] - joints[0, 0])
    assert walked == pytest.approx(captured * height / 1.75, rel=0.03)


def test_a_hop_leaves_the_floor() -> None:
    capture, _ = captured_from("chair", "namco", 0.01)
    # The chair's hop comes only after 7 s, so here the performer is thrown up at half time.
    lift = 0.3 * np.clip(1 - ((np.arange(capture.frames) - 200) / 20.0) ** 2, 0, 1)
    positions = capture.positions.copy()
    positions[..., 1] += lift[:, None] / 0.01
    performer = Performer()
    motion = CapturedMotion(
        performer, Capture(capture.names, capture.parents, positions, capture.rotations, STEP)
    )
    assert performer.soles(motion.figure(200 * STEP)).min() > 0.2
    assert abs(performer.soles(motion.figure(100 * STEP)).min()) < 0.02


def test_motion_begins_at_origin_and_is_still_beyond_its_ends() -> None:
    capture, _ = captured_from("overhead", "plain", yaw=2.0)
    motion = CapturedMotion(Performer(), capture, 0.5, 2.0)
    assert motion.duration == pytest.approx(1.5)
    start = motion.figure(0.0)
    np.testing.assert_allclose(start.joints[0, [0, 2]], 0.0, atol=1e-6)
    across = start.joints[Joint.SHOULDER_LEFT] - start.joints[Joint.SHOULDER_RIGHT]
    assert across[0] > 0.95 * np.linalg.norm(across)
    np.testing.assert_array_equal(motion.figure(-3.0).joints, start.joints)
    np.testing.assert_array_equal(motion.figure(99.0).joints, motion.figure(motion.duration).joints)


def test_capture_without_elbows_lists_its_joints() -> None:
    capture, _ = captured_from("overhead", "cmu")
    names = tuple(name.replace("ForeArm", "Wing") for name in capture.names)
    bird = Capture(names, capture.parents, capture.positions, capture.rotations, STEP)
    with pytest.raises(InputError, match=r"no joint is named as a.* elbow.*LeftWing"):
        CapturedMotion(Performer(), bird)
