"""Finds the bones of Unity's humanoid in a rigged character by the names of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Pose, Skeleton
from enliven.outputs.row_kernels import write_humanoid
from enliven.person import FINGER_BONES, FINGERS, HumanPose
from enliven.rotation import (
    IDENTITY,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    swing,
    unit,
)
from enliven.skeletons.facing import find_facing
from enliven.skeletons.human_names import HumanJoints, HumanLimb, find_human_joints, finger_joints

_DOWN = np.array([0.0, -1.0, 0.0])
_SIDEWAYS = {"Left": np.array([1.0, 0.0, 0.0]), "Right": np.array([-1.0, 0.0, 0.0])}
"""Unit direction of each arm in the T-pose of a person who faces +Z."""


@dataclass(frozen=True)
class HumanoidNode:
    """The joint of a rig at which a humanoid bone begins.

    Attributes:
        bone: name of the bone in Unity's humanoid.
        transform: number of the character's transform that rotates this bone.
        offset: (3,) metres, from that transform's pivot to the joint at rest.
        t_pose: (4,) rotation of the bone from the rest pose to the T-pose, in axes in which the rig faces +Z.
    """

    bone: str
    transform: int
    offset: Float
    t_pose: Float


class HumanoidMap:
    """The humanoid bones of a rigged character.

    Transform j of a character is the link from the parent of joint j to joint j. So the transform of a
    humanoid bone that begins at joint j is the transform of a child of j.

    Args:
        nodes: one or more bones, parents first.
        facing: radians about +Y from +Z to the front of the rig at rest.
    """

    def __init__(self, nodes: list[HumanoidNode], facing: float) -> None:
        self.bones = tuple(node.bone for node in nodes)
        self._transforms: Int = np.array([node.transform for node in nodes])
        self._offsets = np.stack([node.offset for node in nodes])
        # Let r be the rest pose, F the rotation from the rig's front to +Z, C the rotation to the T-pose, and
        # G the rotation of the rig since rest. The T-pose is C F r. The result Q satisfies Q C F r = G r, so
        # Q = G inverse(C F).
        front = from_rotation_vector(np.array([0.0, -facing, 0.0]))
        self._rest_from_t_pose = conjugate(multiply(np.stack([node.t_pose for node in nodes]), front))

    def convert_pose(self, pose: Pose) -> HumanPose:
        """Converts a pose of the character to a human pose."""
        linear = np.require(pose.linear, np.float32, ("C", "W"))
        places = np.require(pose.positions, np.float32, ("C", "W"))
        positions, turns = np.empty((len(self.bones), 3)), np.empty((len(self.bones), 4))
        tables = (self._transforms, self._offsets, self._rest_from_t_pose)
        write_humanoid(linear, places, *tables, positions, turns)
        return HumanPose(pose.character, self.bones, positions, turns)


def humanoid_map(skeleton: Skeleton) -> HumanoidMap | None:
    """Returns the humanoid bones of a skeleton, or None if its joints do not have the names of human
    joints."""
    human = find_human_joints(skeleton)
    if human is None:
        return None
    return _Mapping(skeleton, human).result()


class _Mapping:
    """A builder that collects the humanoid bones of one skeleton."""

    def __init__(self, skeleton: Skeleton, human: HumanJoints) -> None:
        self._skeleton, self._human = skeleton, human
        self._facing = find_facing(skeleton)
        self._front = from_rotation_vector(np.array([0.0, -self._facing, 0.0]))
        self._nodes: list[HumanoidNode] = []

    def result(self) -> HumanoidMap:
        """Returns the map."""
        human = self._human
        self._add_trunk()
        for side, arm, leg in zip(("Left", "Right"), human.arms, human.legs, strict=True):
            self._add_arm(side, arm)
            self._add_leg(side, leg)
        return HumanoidMap(self._nodes, self._facing)

    def _add_trunk(self) -> None:
        human, skeleton = self._human, self._skeleton
        head = list(human.head)
        if human.hips == 0:
            self._add_transform("Hips", 0, 0)
        else:
            self._add("Hips", human.hips, self._next(human.hips, human.legs[0].knots[0]))
        path = skeleton.path(human.hips, human.chest)
        trunk = [joint for parent, joint in pairwise(path) if skeleton.parents[joint] == parent]
        above = [*trunk[1:], head[1] if len(head) > 1 else self._next(human.chest, human.arms[0].knots[0])]
        names = ("Spine", "Chest", "UpperChest")
        # If the trunk has more than three joints, use the first one and the last two.
        chosen = list(range(len(trunk))) if len(trunk) <= 3 else [0, len(trunk) - 2, len(trunk) - 1]
        for name, number in zip(names, chosen, strict=False):
            self._add(name, trunk[number], above[number])
        knots = human.head_knots
        for name, joint in zip(("Neck", "Head") if len(knots) > 1 else ("Head",), knots, strict=True):
            after = head[head.index(joint) + 1 :]
            self._add(name, joint, after[0] if after else -1)

    def _add_arm(self, side: str, arm: HumanLimb) -> None:
        upper, lower, hand = arm.knots
        collar = self._skeleton.path(self._human.chest, upper)[1:-1]
        if collar:
            self._add(f"{side}Shoulder", collar[0], self._next(collar[0], upper))
        outwards = _SIDEWAYS[side]
        self._add(
            f"{side}UpperArm", upper, self._next(upper, lower), self._straighten_limb(upper, lower, outwards)
        )
        straight = self._straighten_limb(lower, hand, outwards)
        self._add(f"{side}LowerArm", lower, self._next(lower, hand), straight)
        self._add(f"{side}Hand", hand, arm.tip, straight)
        for finger, chain in finger_joints(self._skeleton, hand).items():
            for part, joint, after in zip(FINGER_BONES, chain[1:], [*chain[2:], -1], strict=False):
                self._add(f"{side}{FINGERS[finger]}{part}", joint, after, straight)

    def _add_leg(self, side: str, leg: HumanLimb) -> None:
        upper, lower, foot = leg.knots
        self._add(
            f"{side}UpperLeg", upper, self._next(upper, lower), self._straighten_limb(upper, lower, _DOWN)
        )
        self._add(
            f"{side}LowerLeg", lower, self._next(lower, foot), self._straighten_limb(lower, foot, _DOWN)
        )
        self._add(f"{side}Foot", foot, leg.tip)
        if leg.tip >= 0:
            self._add(f"{side}Toes", leg.tip, -1)

    def _next(self, joint: int, end: int) -> int:
        """Returns the child of ``joint`` on the path to its descendant ``end``."""
        return (*self._skeleton.path(joint, end), joint)[1]

    def _straighten_limb(self, start: int, end: int, direction: Float) -> Float:
        """Returns the rotation (4,) from the rest direction of a limb to its direction in the T-pose."""
        positions = self._skeleton.positions
        rest_direction = unit(rotate(self._front, positions[end] - positions[start]))
        return swing(rest_direction, direction) if np.any(rest_direction) else IDENTITY

    def _add(self, bone: str, joint: int, child: int, t_pose: Float = IDENTITY) -> None:
        """Adds the bone from a joint to its child. ``child`` is -1 if the joint has no child."""
        self._add_transform(bone, joint, child if child >= 0 else joint, t_pose)

    def _add_transform(self, bone: str, joint: int, transform: int, t_pose: Float = IDENTITY) -> None:
        skeleton = self._skeleton
        pivot = skeleton.positions[max(int(skeleton.parents[transform]), 0)]
        self._nodes.append(HumanoidNode(bone, transform, skeleton.positions[joint] - pivot, t_pose))
