"""Human poses in terms of the bones of Unity's humanoid, computed from a performer's body or a rigged
character.

The rotation of a bone is relative to the T-pose: upright, facing +Z, arms stretched out sideways with palms
down. So all rotations of a figure in the T-pose are the identity, independent of the rest pose of its rig.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from enliven.arrays import Float, Int
from enliven.person.body import Body
from enliven.person.human_kernels import write_human
from enliven.person.joints import Joint
from enliven.rotation import (
    conjugate,
    from_matrix,
    from_rotation_vector,
    multiply,
    rotate,
    swing,
    unit,
)

_PARENT_NAMES = {
    "Hips": "",
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
    **{f"{side}Shoulder": "UpperChest" for side in ("Left", "Right")},
    **{f"{side}UpperArm": f"{side}Shoulder" for side in ("Left", "Right")},
    **{f"{side}LowerArm": f"{side}UpperArm" for side in ("Left", "Right")},
    **{f"{side}Hand": f"{side}LowerArm" for side in ("Left", "Right")},
    **{f"{side}UpperLeg": "Hips" for side in ("Left", "Right")},
    **{f"{side}LowerLeg": f"{side}UpperLeg" for side in ("Left", "Right")},
    **{f"{side}Foot": f"{side}LowerLeg" for side in ("Left", "Right")},
    **{f"{side}Toes": f"{side}Foot" for side in ("Left", "Right")},
}
"""Bones of Unity's humanoid (HumanBodyBones) without fingers, parents first, and the parent of each."""
FINGERS = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}
"""Unity's word for each finger."""
FINGER_BONES = ("Proximal", "Intermediate", "Distal")
"""Unity's words for the bones of a finger, from the hand outwards."""


@dataclass(frozen=True, eq=False)
class HumanPose:
    """The pose of a human figure at one time, world frame.

    Attributes:
        name: id of the character, or ``performer-N``.
        bones: (B,) names of Unity's HumanBodyBones, parents first. "Hips" is the first.
        positions: (B, 3) positions at which the bones begin, metres.
        turns: (B, 4) unit quaternions (w, x, y, z): the rotation of each bone since the T-pose.
    """

    name: str
    bones: tuple[str, ...]
    positions: Float
    turns: Float

    @property
    def parents(self) -> Int:
        """(B,) the nearest ancestor of each bone in ``bones``, -1 for the hips."""
        return find_nearest_ancestors(self.bones)

    @staticmethod
    def sort_bones(bones: Iterable[str]) -> list[str]:
        """Returns the given bones in the order of the humanoid, parents first. Unknown names are left out."""
        return sorted((bone for bone in bones if bone in _PARENT_NAMES), key=list(_PARENT_NAMES).index)

    @staticmethod
    def ancestors(bone: str) -> Iterator[str]:
        """Yields the ancestors of a bone, from its parent to the hips."""
        while bone := parent_name(bone):
            yield bone

    def local(self) -> tuple[Float, Float]:
        """Returns positions (B, 3) and rotations (B, 4), each relative to the parent bone.

        The hips are relative to the world.
        """
        parents = self.parents
        root = parents < 0
        parent_turns = np.where(root[:, None], np.array([1.0, 0.0, 0.0, 0.0]), self.turns[parents])
        inverse_turns = conjugate(parent_turns)
        offsets = self.positions - np.where(root[:, None], 0.0, self.positions[parents])
        return rotate(inverse_turns, offsets), multiply(inverse_turns, self.turns)

    def get_bone(self, bone: str) -> tuple[Float, Float]:
        """Returns the position (3,) and the rotation (4,) of a bone, which must exist in the pose."""
        number = self.bones.index(bone)
        return self.positions[number], self.turns[number]


@cache
def find_nearest_ancestors(bones: tuple[str, ...]) -> Int:
    """Returns the number (B,) of the nearest existing ancestor of each bone, -1 if there is none."""
    numbers = {bone: number for number, bone in enumerate(bones)}
    parents = np.full(len(bones), -1)
    for number, bone in enumerate(bones):
        parent = parent_name(bone)
        while parent and parent not in numbers:
            parent = parent_name(parent)
        parents[number] = numbers.get(parent, -1)
    return parents


def parent_name(bone: str) -> str:
    """Returns the parent of a bone in Unity's humanoid, or an empty string for the hips."""
    if bone in _PARENT_NAMES:
        return _PARENT_NAMES[bone]
    for parent, child in pairwise(FINGER_BONES):
        if bone.endswith(child):
            return bone.removesuffix(child) + parent
    return "LeftHand" if bone.startswith("Left") else "RightHand"


# --- performers --------------------------------------------------------------------------------------------

_BODY_BONES: tuple[tuple[str, Joint, Joint], ...] = (
    ("Hips", Joint.HIP_CENTER, Joint.HIP_CENTER),
    ("Spine", Joint.SPINE, Joint.HIP_CENTER),
    ("Chest", Joint.SHOULDER_CENTER, Joint.SPINE),
    ("Neck", Joint.HEAD, Joint.SHOULDER_CENTER),
    ("Head", Joint.HEAD, Joint.HEAD),
    *(
        (f"{side.title()}{bone}", Joint[f"{ends}_{side}"], Joint[f"{begins}_{side}"])
        for side in ("LEFT", "RIGHT")
        for bone, ends, begins in (
            ("Shoulder", "SHOULDER", "SHOULDER"),
            ("UpperArm", "ELBOW", "SHOULDER"),
            ("LowerArm", "WRIST", "ELBOW"),
            ("Hand", "HAND", "WRIST"),
            ("UpperLeg", "KNEE", "HIP"),
            ("LowerLeg", "ANKLE", "KNEE"),
            ("Foot", "FOOT", "ANKLE"),
            ("Toes", "FOOT", "FOOT"),
        )
    ),
)
"""Bones of a performer: name, end joint of the tracked bone that provides the rotation, and joint at which
the bone begins."""
BODY_BONE_NAMES = tuple(name for name, _, _ in _BODY_BONES)
"""Names of the bones of a performer, in the order of :func:`human_of_body`."""
_ENDS = np.array([int(ends) for _, ends, _ in _BODY_BONES])
_BEGINS = np.array([int(begins) for _, _, begins in _BODY_BONES])


def _t_pose_from_hanging() -> Float:
    """Returns the rotation (B, 4) from hanging to outstretched arms, for each bone of a performer."""
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(_BODY_BONES), 1))
    for number, (name, _, _) in enumerate(_BODY_BONES):
        if name.endswith(("UpperArm", "LowerArm", "Hand")):
            quarter = np.pi / 2 if name.startswith("Left") else -np.pi / 2
            turns[number] = from_rotation_vector(np.array([0.0, 0.0, quarter]))
    return turns


_T_POSE_FROM_HANGING = _t_pose_from_hanging()
"""(B, 4) the rotation from hanging arms to the T-pose."""
_HANGING_FROM_T_POSE = conjugate(_T_POSE_FROM_HANGING)
"""(B, 4) the rotation from the T-pose to the pose of a standing person with hanging arms."""
_NUMBERS = {name: number for number, name in enumerate(BODY_BONE_NAMES)}
_TRUNK_BONES = np.array(
    [_NUMBERS[name] for name in ("Hips", "Spine", "Chest", "Neck", "Head", "LeftShoulder", "RightShoulder")]
)
"""(7,) numbers of the bones for the argument ``bones`` of :func:`write_human`."""


def human_of_body(body: Body, name: str) -> HumanPose:
    """Returns the pose of a performer. For a body without measured orientations, they are computed from its
    joints.
    """
    joints = np.require(body.joints, np.float64, ("C", "W"))
    orientations = orientations_of_joints(joints) if body.orientations is None else body.orientations
    orientations = np.require(orientations, np.float64, ("C", "W"))
    positions, turns = np.empty((len(_BEGINS), 3)), np.empty((len(_BEGINS), 4))
    write_human(*(joints, orientations, _BEGINS, _ENDS, _HANGING_FROM_T_POSE, _TRUNK_BONES, positions, turns))
    return HumanPose(name, BODY_BONE_NAMES, positions, turns)


_REFERENCE_HEIGHT_M = 1.75
"""Height in metres of the person in ``_T_POSE_PLACES``."""
_T_POSE_PLACES = {
    "Hips": (0.0, 0.90, 0.0),
    "Spine": (0.0, 0.96, 0.0),
    "Chest": (0.0, 1.02, 0.0),
    "UpperChest": (0.0, 1.15, 0.0),
    "Neck": (0.0, 1.33, 0.0),
    "Head": (0.0, 1.42, 0.01),
    **{
        f"{side}{bone}": (sign * x, y, z)
        for side, sign in (("Left", 1.0), ("Right", -1.0))
        for bone, x, y, z in (
            ("Shoulder", 0.05, 1.32, 0.0),
            ("UpperArm", 0.185, 1.28, 0.0),
            ("LowerArm", 0.47, 1.28, 0.0),
            ("Hand", 0.72, 1.28, 0.0),
            ("UpperLeg", 0.085, 0.82, 0.0),
            ("LowerLeg", 0.085, 0.39, 0.0),
            ("Foot", 0.085, -0.02, 0.0),
            ("Toes", 0.085, -0.06, 0.12),
        )
    },
}
"""Position at which each bone begins in the T-pose of an average person, metres. Only differences between
positions are used."""
_HEAD_ABOVE_SKULL = np.array([0.0, 0.09, 0.01])
"""(3,) vector from the start of the head bone to the middle of the head of an average person, metres."""
_HAND_LENGTH_M = 0.085
"""Distance from the wrist to the middle of the hand of an average person, metres."""


def compute_standing_offset(bone: str, parent: str, height: float) -> Float:
    """Returns the offset from a parent bone to a bone in the T-pose of an average person, (3,) in metres.

    Args:
        height: height of the person, metres.
    """
    offset = np.subtract(_T_POSE_PLACES[bone], _T_POSE_PLACES[parent])
    return np.asarray(offset * (height / _REFERENCE_HEIGHT_M))


def body_from_human_pose(human: HumanPose, id: int) -> Body:
    """Converts a human pose to a body. It is the inverse of :func:`human_of_body`.

    A joint without its bones is placed by average proportions, and has confidence 0. The size of the person
    is measured from the legs. Without legs, an average size is assumed.
    """
    places, turns, sizes = dict[str, Float](), dict[str, Float](), list[float]()
    for bone, place, turn in zip(human.bones, human.positions, human.turns, strict=True):
        places[bone], turns[bone] = place, turn
    for side in ("Left", "Right"):
        for upper, lower in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"), ("UpperArm", "LowerArm")):
            if f"{side}{upper}" in places and f"{side}{lower}" in places:
                length = np.linalg.norm(places[f"{side}{upper}"] - places[f"{side}{lower}"])
                usual = np.linalg.norm(compute_standing_offset(f"{side}{lower}", f"{side}{upper}", 1.0))
                sizes.append(float(length / usual))
    height = float(np.median(sizes)) if sizes else _REFERENCE_HEIGHT_M
    scale = height / _REFERENCE_HEIGHT_M
    present = set(places)
    for bone in HumanPose.sort_bones(_PARENT_NAMES):
        if bone not in places:
            parent = next(above for above in HumanPose.ancestors(bone) if above in places)
            places[bone] = places[parent] + rotate(
                turns[parent], compute_standing_offset(bone, parent, height)
            )
            turns[bone] = turns[parent]
    joints, confidence = np.empty((len(Joint), 3)), np.zeros(len(Joint))
    orientations = np.empty((len(Joint), 4))

    def put(joint: Joint, place: Float, carrier: str, *bones: str) -> None:
        joints[joint] = place
        orientations[joint] = multiply(turns[carrier], _T_POSE_FROM_HANGING[_NUMBERS[carrier]])
        confidence[joint] = float(present.issuperset(bones))

    trunk = "UpperChest" if "UpperChest" in present else "Chest" if "Chest" in present else "Spine"
    put(Joint.HIP_CENTER, places["Hips"], "Hips", "Hips")
    put(Joint.SPINE, places["Chest"], "Hips", "Hips")
    put(Joint.SHOULDER_CENTER, places["Neck"], "Chest", "Spine")
    # The head bone of a rig has no end, so place the middle of the head at an average distance.
    put(Joint.HEAD, places["Head"] + rotate(turns["Head"], scale * _HEAD_ABOVE_SKULL), "Head", "Head")
    orientations[Joint.SHOULDER_CENTER] = turns[trunk]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joint = {name: Joint[f"{name}_{side.upper()}"] for name in _SIDE_JOINTS}
        hand_offset = np.array([sign * scale * _HAND_LENGTH_M, 0.0, 0.0])
        hand = places[f"{side}Hand"] + rotate(turns[f"{side}Hand"], hand_offset)
        put(joint["SHOULDER"], places[f"{side}UpperArm"], "Chest", f"{side}UpperArm")
        orientations[joint["SHOULDER"]] = turns[trunk]
        put(
            joint["ELBOW"], places[f"{side}LowerArm"], f"{side}UpperArm", f"{side}UpperArm", f"{side}LowerArm"
        )
        put(joint["WRIST"], places[f"{side}Hand"], f"{side}LowerArm", f"{side}LowerArm", f"{side}Hand")
        put(joint["HAND"], hand, f"{side}Hand", f"{side}Hand")
        put(joint["HIP"], places[f"{side}UpperLeg"], "Hips", f"{side}UpperLeg")
        put(joint["KNEE"], places[f"{side}LowerLeg"], f"{side}UpperLeg", f"{side}UpperLeg", f"{side}LowerLeg")
        put(joint["ANKLE"], places[f"{side}Foot"], f"{side}LowerLeg", f"{side}LowerLeg", f"{side}Foot")
        put(joint["FOOT"], places[f"{side}Toes"], f"{side}Foot", f"{side}Foot")
    return Body(id, joints, confidence, orientations, stature=height)


_SIDE_JOINTS = ("SHOULDER", "ELBOW", "WRIST", "HAND", "HIP", "KNEE", "ANKLE", "FOOT")
"""Names of the joints of one side of the body, without the side."""
_DOWN = np.array([0.0, -1.0, 0.0])
_LEVEL_FOOT = unit(np.array([0.0, -0.5, 0.866]))
"""Unit direction from ankle to foot if the sole is horizontal: 30 degrees below the horizontal."""


def orientations_of_joints(joints: Float) -> Float:
    """Computes the orientations (20, 4) of the bones from the joints (20, 3), as in
    :class:`enliven.person.Body`.

    The trunk follows the lines of the hips and shoulders. A bone of a limb is rotated from its parent by the
    shortest arc, because its twist is unknown. The head follows the chest.
    """
    pelvis = _trunk_turn(joints, Joint.HIP_CENTER, Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT)
    chest = _trunk_turn(joints, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)
    turns = np.tile(pelvis, (len(joints), 1))
    turns[[Joint.SHOULDER_CENTER, Joint.HEAD]] = chest
    for side in ("LEFT", "RIGHT"):
        turns[Joint[f"SHOULDER_{side}"]] = chest
        for turn, names in (
            (chest, ("SHOULDER", "ELBOW", "WRIST", "HAND")),
            (pelvis, ("HIP", "KNEE", "ANKLE", "FOOT")),
        ):
            for begins, ends in pairwise(names):
                end = Joint[f"{ends}_{side}"]
                rest = _LEVEL_FOOT if ends == "FOOT" else _DOWN
                direction = unit(joints[end] - joints[Joint[f"{begins}_{side}"]])
                if np.any(direction):
                    turn = multiply(swing(rotate(turn, rest), direction), turn)
                turns[end] = turn
    return turns


def _trunk_turn(joints: Float, low: Joint, high: Joint, left: Joint, right: Joint) -> Float:
    """Returns the rotation (4,) of a part of the trunk. It is computed from the upward direction, and from
    the line between the right and the left joint.
    """
    up = unit(joints[high] - joints[low])
    leftward = joints[left] - joints[right]
    leftward = unit(leftward - (leftward @ up) * up)
    return from_matrix(np.stack([leftward, up, np.cross(leftward, up)], -1))
