"""Retargets a tracked person's bone directions onto the skeleton of the key poses.

Takes can have any skeleton. Its bones are paired with a tracked person's bones by anatomy: arms with arms,
legs with legs, and each bone by its relative position along the limb. Takes of tracked people have the same
bones, which are paired one to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.person import BODY_NAMES, Body, Joint
from enliven.possession import rotation_about_y
from enliven.skeletons.anatomy import Anatomy, SkeletonLimb, find_anatomy
from enliven.skeletons.facing import find_facing
from enliven_edge.stage.puppet.bones import BonePose, BoneTracker

ARMS = (
    (Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT),
    (Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT),
)
"""The joints of the left and the right arm, from the trunk outwards."""
LEGS = (
    (Joint.HIP_LEFT, Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT),
    (Joint.HIP_RIGHT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT),
)
"""The joints of the left and the right leg, from the trunk outwards."""
_ARM = np.array([0.29, 0.26, 0.08])
"""Lengths of an average adult's upper arm, forearm and hand, in metres. They determine the relative positions
of the joints along an arm."""
_LEG = np.array([0.42, 0.42, 0.16])
"""Lengths of an average adult's thigh, shank and foot, in metres. They determine the relative positions of
the joints along a leg."""
_PELVIS = 0
"""Index of the pelvis among the rotations of the trunk."""
_CHEST = 1
"""Index of the chest among the rotations of the trunk."""
_HEAD = 2
"""Index of the head among the rotations of the trunk."""


@dataclass(frozen=True)
class _Bone:
    """The bone of a tracked person that a bone of the take follows.

    Attributes:
        joint: the tracked joint at the end of the bone that it follows or that is most similar.
        turn: the index of the trunk part that rotates the bone (pelvis, chest, head), or -1 if it points
            along the followed bone.
    """

    joint: Joint
    turn: int = -1


class Retargeting:
    """Computes the positions of the paired joints on the skeleton of the key poses.

    Paired joints are joints that control points follow.

    Args:
        skeleton: the skeleton of the takes of the key poses.
        joints: (P,) names of the paired joints.

    Attributes:
        joints: (P,) the tracked joint that each paired joint is most similar to.
        legs: metres, length of thigh plus shank of the skeleton, the mean of its legs.

    Raises:
        InputError: for a joint that is not in the skeleton, or that no joint of a tracked person is similar
            to.
    """

    def __init__(self, skeleton: Skeleton, joints: Sequence[str]) -> None:
        self._skeleton = skeleton
        numbers = [skeleton.index(name) for name in joints]
        same = _pair_same_bones(skeleton)
        bones = same or _pair_similar_bones(skeleton)
        self._facing = rotation_about_y(_compute_rest_yaw(skeleton, same) if same else find_facing(skeleton))
        self._paths = [skeleton.path(0, number)[1:] for number in numbers]
        used = sorted({joint for path in self._paths for joint in path})
        for joint in used:
            if joint not in bones:
                name = next(n for n, path in zip(joints, self._paths, strict=True) if joint in path)
                raise InputError(
                    f"a tracked person has no joint similar to {name!r} of the examples",
                    where="puppet",
                    remedy="Pair the control points of the puppet with joints of the head, trunk, arms or "
                    "legs.",
                )
        self.joints = tuple(bones[n].joint if n else Joint.HIP_CENTER for n in numbers)
        self.legs = _leg_length(skeleton, bones)
        self._used = np.array(used, np.int64)
        self._directs = np.array([bones[j].turn < 0 for j in used], np.bool_)
        self._followed = np.array([bones[j].joint for j in used], np.int64)
        self._turns = np.array([max(bones[j].turn, 0) for j in used], np.int64)
        self._rest = skeleton.vectors[self._used] @ self._facing
        self._lengths = skeleton.lengths[self._used][:, None]
        self._chains = np.zeros((len(joints), len(used)))
        for row, path in enumerate(self._paths):
            self._chains[row, [used.index(joint) for joint in path]] = 1.0

    def compute_pose(self, seen: BonePose) -> Float:
        """Returns the joints (P, 3) in metres, in the body frame.

        The bone lengths are those of the performer of the key poses.
        """
        turns = np.stack([seen.pelvis, seen.chest, seen.head])[self._turns]
        carried = np.einsum("nab,nb->na", turns, self._rest)
        along = seen.directions[self._followed] * self._lengths
        vectors = np.where(self._directs[:, None], along, carried)
        return np.asarray(self._chains @ vectors @ self._facing.T)


def _pair_same_bones(skeleton: Skeleton) -> dict[int, _Bone]:
    """Returns the bones of a tracked person's skeleton, paired one to one. The result is empty for other
    skeletons.
    """
    joints_by_name = {_normalise_name(name): Joint(k) for k, name in enumerate(BODY_NAMES)}
    if {_normalise_name(name) for name in skeleton.names} != set(joints_by_name):
        return {}
    return {k: _Bone(joints_by_name[_normalise_name(name)]) for k, name in enumerate(skeleton.names)}


def _leg_length(skeleton: Skeleton, bones: dict[int, _Bone]) -> float:
    """Returns the length of thigh plus shank in metres, the mean of both legs.

    Without legs it returns half of the extent.
    """
    parts = {joint for leg in LEGS for joint in leg[1:3]}
    legs = [skeleton.lengths[j] for j, bone in bones.items() if bone.joint in parts and bone.turn < 0]
    return 0.5 * float(np.sum(legs) if legs else np.ptp(skeleton.positions, axis=0).max())


def _compute_rest_yaw(skeleton: Skeleton, bones: dict[int, _Bone]) -> float:
    """Returns the facing of a tracked person at rest in radians about +Y, computed from the hips."""
    joints = np.zeros((len(Joint), 3))
    joints[[bone.joint for bone in bones.values()]] = skeleton.positions
    return BoneTracker(0.0).update(Body(0, joints, np.ones(len(Joint))), 0.0).yaw


def _normalise_name(name: str) -> str:
    return name.lower().replace("_", "").replace(" ", "")


def _pair_similar_bones(skeleton: Skeleton) -> dict[int, _Bone]:
    """Returns the bones paired by anatomy. Bones that are not similar to any bone of a person are left
    out.
    """
    anatomy = find_anatomy(skeleton)
    bones: dict[int, _Bone] = {}
    _add_trunk(anatomy, bones)
    for pairs, chains, lengths in ((anatomy.arms, ARMS, _ARM), (anatomy.legs, LEGS, _LEG)):
        for pair in pairs[:1]:
            for limb, chain in zip(pair, chains, strict=True):
                _add_limb(skeleton, limb, chain, lengths, bones)
    if anatomy.head is not None:
        for joint in anatomy.head.chain[1:]:
            bones[joint] = _Bone(Joint.HEAD, _HEAD)
    _add_small_branches(skeleton, anatomy, bones)
    return bones


def _add_trunk(anatomy: Anatomy, bones: dict[int, _Bone]) -> None:
    """Adds the trunk. The lower half rotates with the pelvis, the upper half with the chest."""
    trunk = anatomy.trunk[1:]
    for k, joint in enumerate(trunk):
        low = k < len(trunk) / 2 - 0.5
        bones[joint] = _Bone(Joint.SPINE if low else Joint.SHOULDER_CENTER, _PELVIS if low else _CHEST)


def _add_limb(
    skeleton: Skeleton, limb: SkeletonLimb, chain: Sequence[Joint], lengths: Float, bones: dict[int, _Bone]
) -> None:
    """Adds a limb.

    Its girdle rotates with the trunk. Each bone follows the person's bone at the same relative length.
    """
    grounded = chain[0] in (Joint.HIP_LEFT, Joint.HIP_RIGHT)
    for joint in limb.girdle[1:]:
        bones[joint] = _Bone(chain[0], _PELVIS if grounded else _CHEST)
    arc_lengths = np.cumsum(skeleton.lengths[list(limb.proper[1:])])
    if len(arc_lengths) == 0:
        return
    middles = (arc_lengths - 0.5 * skeleton.lengths[list(limb.proper[1:])]) / max(arc_lengths[-1], 1e-9)
    ends = np.cumsum(lengths) / lengths.sum()
    for joint, middle in zip(limb.proper[1:], middles, strict=True):
        bones[joint] = _Bone(chain[1 + min(int(np.searchsorted(ends, middle)), len(ends) - 1)])


def _add_small_branches(skeleton: Skeleton, anatomy: Anatomy, bones: dict[int, _Bone]) -> None:
    """Adds small branches at hands, feet, head or root. Each branch follows its parent. Tails follow no
    bone.
    """
    tail = set(anatomy.tail.chain[1:]) if anatomy.tail is not None else set()
    limbs = {
        joint for pair in (*anatomy.arms[1:], *anatomy.legs[1:]) for limb in pair for joint in limb.chain
    }
    for joint in range(1, len(skeleton)):
        parent = int(skeleton.parents[joint])
        if joint in bones or joint in tail or joint in limbs - set(bones):
            continue
        if parent == 0:
            bones[joint] = _Bone(Joint.HIP_CENTER, _PELVIS)
        elif parent in bones:
            bones[joint] = bones[parent]
