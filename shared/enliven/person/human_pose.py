"""The pose of a human figure as bones of Unity's humanoid, from a performer's body or a rigged character.

The rotation of a bone is measured from the T-pose: upright, facing +Z, arms held out sideways with the palms
down. So a figure in the T-pose has the identity everywhere, whatever the rest pose of its rig is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from enliven.arrays import Float, Int
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.rotation import (
    conjugate,
    from_matrix,
    from_rotation_vector,
    multiply,
    rotate,
    slerp,
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
"""Unity's words for the bones of a finger, from the hand."""


@dataclass(frozen=True, eq=False)
class HumanPose:
    """A human figure at one moment, world frame.

    Attributes:
        name: id of the character, or ``performer-N``.
        bones: (B,) names of Unity's HumanBodyBones, parents first. "Hips" is the first.
        positions: (B, 3) metres, where each bone begins.
        turns: (B, 4) unit quaternions (w, x, y, z): the rotation of each bone since the T-pose.
    """

    name: str
    bones: tuple[str, ...]
    positions: Float
    turns: Float

    @property
    def parents(self) -> Int:
        """(B,) the nearest ancestor of each bone in ``bones``, -1 for the hips."""
        return parents_of(self.bones)

    @staticmethod
    def ordered(bones: Iterable[str]) -> list[str]:
        """Returns the known ones of some bones, parents first."""
        return sorted((bone for bone in bones if bone in _PARENT_NAMES), key=list(_PARENT_NAMES).index)

    @staticmethod
    def ancestors(bone: str) -> Iterator[str]:
        """Yields the bones above a bone, from its parent to the hips."""
        while bone := parent_name(bone):
            yield bone

    def local(self) -> tuple[Float, Float]:
        """Returns (B, 3) positions and (B, 4) rotations, each relative to the parent bone.

        The hips are relative to the world.
        """
        parents = self.parents
        root = parents < 0
        above = np.where(root[:, None], np.array([1.0, 0.0, 0.0, 0.0]), self.turns[parents])
        back = conjugate(above)
        offsets = self.positions - np.where(root[:, None], 0.0, self.positions[parents])
        return rotate(back, offsets), multiply(back, self.turns)

    def at(self, bone: str) -> tuple[Float, Float]:
        """Returns the (3,) position and (4,) rotation of a bone. The figure must have it."""
        number = self.bones.index(bone)
        return self.positions[number], self.turns[number]


@cache
def parents_of(bones: tuple[str, ...]) -> Int:
    """Returns (B,) the number of the nearest existing ancestor of each bone, -1 if there is none."""
    numbers = {bone: number for number, bone in enumerate(bones)}
    parents = np.full(len(bones), -1)
    for number, bone in enumerate(bones):
        parent = parent_name(bone)
        while parent and parent not in numbers:
            parent = parent_name(parent)
        parents[number] = numbers.get(parent, -1)
    return parents


def parent_name(bone: str) -> str:
    """Returns the parent of a bone in Unity's humanoid. Empty for the hips."""
    if bone in _PARENT_NAMES:
        return _PARENT_NAMES[bone]
    for before, after in pairwise(FINGER_BONES):
        if bone.endswith(after):
            return bone.removesuffix(after) + before
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
"""Bones of a performer: name, end joint of the bone with its rotation, and the joint where it begins."""
BODY_BONE_NAMES = tuple(name for name, _, _ in _BODY_BONES)
"""Names of the bones of a performer, in the order of :func:`human_of_body`."""
_ENDS = np.array([ends for _, ends, _ in _BODY_BONES])
_BEGINS = np.array([begins for _, _, begins in _BODY_BONES])
_COLLAR_FRACTION = 0.25
"""Fraction of the way from the neck to the shoulder where the collar bone begins."""
_SKULL_FRACTION = 0.5
"""Fraction of the way from the neck to the middle of the head where the head bone begins."""


def _t_pose_from_hanging() -> Float:
    """Returns (B, 4) the rotation from hanging arms to arms held out, for each bone of a performer."""
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


def human_of_body(body: Body, name: str) -> HumanPose:
    """Returns the pose of a performer. A body without measured orientations gets those of its joints."""
    joints = body.joints
    orientations = orientations_of_joints(joints) if body.orientations is None else body.orientations
    positions = joints[_BEGINS].copy()
    turns = multiply(orientations[_ENDS], _HANGING_FROM_T_POSE)
    spine, neck = _NUMBERS["Spine"], _NUMBERS["Neck"]
    # The tracker's trunk has two parts and the humanoid's has three, and the same holds for neck and head.
    # The bone between shares the rotation of its neighbours equally.
    halves = slerp(
        turns[[_NUMBERS["Hips"], _NUMBERS["Chest"]]],
        turns[[_NUMBERS["Chest"], _NUMBERS["Head"]]],
        np.array(0.5),
    )
    turns[spine], turns[neck] = halves
    positions[spine] = 0.5 * (joints[Joint.HIP_CENTER] + joints[Joint.SPINE])
    way = joints[Joint.HEAD] - joints[Joint.SHOULDER_CENTER]
    positions[_NUMBERS["Head"]] = joints[Joint.SHOULDER_CENTER] + _SKULL_FRACTION * way
    for side, shoulder in (("Left", Joint.SHOULDER_LEFT), ("Right", Joint.SHOULDER_RIGHT)):
        across = joints[shoulder] - joints[Joint.SHOULDER_CENTER]
        positions[_NUMBERS[f"{side}Shoulder"]] = joints[Joint.SHOULDER_CENTER] + _COLLAR_FRACTION * across
    return HumanPose(name, BODY_BONE_NAMES, positions, turns)


_REFERENCE_HEIGHT_M = 1.75
"""Height in metres of the person with the offsets of ``_T_POSE_PLACES``."""
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
"""Where each bone begins in the T-pose of an average person, in metres. Only differences count."""
_HEAD_ABOVE_SKULL = np.array([0.0, 0.09, 0.01])
"""(3,) metres from the beginning of the head bone to the middle of the head, of the average person."""
_HAND_LENGTH_M = 0.085
"""Metres from the wrist to the middle of the hand, of the average person."""


def standing_offset(bone: str, parent: str, height: float) -> Float:
    """Returns (3,) metres from a parent bone to a bone in the T-pose of an average person.

    Args:
        height: metres of the person.
    """
    offset = np.subtract(_T_POSE_PLACES[bone], _T_POSE_PLACES[parent])
    return np.asarray(offset * (height / _REFERENCE_HEIGHT_M))


def body_of_human(human: HumanPose, id: int) -> Body:
    """Returns the body of a human pose, the inverse of :func:`human_of_body`.

    A joint without its bones is placed by average proportions, and has confidence 0. The size of the person
    is measured by the legs or, without them, assumed.
    """
    places, turns, sizes = dict[str, Float](), dict[str, Float](), list[float]()
    for bone, place, turn in zip(human.bones, human.positions, human.turns, strict=True):
        places[bone], turns[bone] = place, turn
    for side in ("Left", "Right"):
        for upper, lower in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"), ("UpperArm", "LowerArm")):
            if f"{side}{upper}" in places and f"{side}{lower}" in places:
                length = np.linalg.norm(places[f"{side}{upper}"] - places[f"{side}{lower}"])
                usual = np.linalg.norm(standing_offset(f"{side}{lower}", f"{side}{upper}", 1.0))
                sizes.append(float(length / usual))
    height = float(np.median(sizes)) if sizes else _REFERENCE_HEIGHT_M
    scale = height / _REFERENCE_HEIGHT_M
    present = set(places)
    for bone in HumanPose.ordered(_PARENT_NAMES):
        if bone not in places:
            parent = next(above for above in HumanPose.ancestors(bone) if above in places)
            places[bone] = places[parent] + rotate(turns[parent], standing_offset(bone, parent, height))
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
    # The head bone of a rig has no end, so the middle of the head lies at a usual distance.
    put(Joint.HEAD, places["Head"] + rotate(turns["Head"], scale * _HEAD_ABOVE_SKULL), "Head", "Head")
    orientations[Joint.SHOULDER_CENTER] = turns[trunk]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        joint = {name: Joint[f"{name}_{side.upper()}"] for name in _SIDE_JOINTS}
        along = np.array([sign * scale * _HAND_LENGTH_M, 0.0, 0.0])
        hand = places[f"{side}Hand"] + rotate(turns[f"{side}Hand"], along)
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
"""Names of the joints of one side of the body."""
_DOWN = np.array([0.0, -1.0, 0.0])
_LEVEL_FOOT = unit(np.array([0.0, -0.5, 0.866]))
"""Unit direction from ankle to foot of a level sole: 30 degrees below the horizontal."""


def orientations_of_joints(joints: Float) -> Float:
    """Returns (20, 4) orientations of the bones from (20, 3) joints, as in :class:`enliven.person.Body`.

    The trunk follows the lines of the hips and shoulders. A limb is rotated from its parent by the shortest
    arc, so its twist is not known. The head follows the chest.
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
    """Returns the (4,) rotation of a part of the trunk from its direction and the line across it."""
    up = unit(joints[high] - joints[low])
    across = joints[left] - joints[right]
    across = unit(across - (across @ up) * up)
    return from_matrix(np.stack([across, up, np.cross(across, up)], -1))
