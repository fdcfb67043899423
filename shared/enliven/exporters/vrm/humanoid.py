"""Finds the humanoid bones of VRM 1.0 in a skeleton by the names of its joints, and computes the T-pose.

A VRM bone begins at a joint. It has the rotation of the skeleton's bone that begins there. In the T-pose of
VRM 1.0 the avatar faces +Z, its left arm points to +X, and its legs point down.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.rotation import from_rotation_vector, multiply, rotate, swing, unit
from enliven.skeletons.facing import find_facing
from enliven.skeletons.human_names import HumanJoints, HumanLimb, find_human_joints, finger_joints

_LEFT_DIRECTION = np.array([1.0, 0.0, 0.0])
_DOWN_DIRECTION = np.array([0.0, -1.0, 0.0])
_SPINE_NAMES = ("spine", "chest", "upperChest")
"""VRM names of the bones between hips and neck."""
_LIMB_ENDS = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}
"""For each bone that the T-pose straightens, the bone at its end."""
_FINGER_SEGMENTS = ("Proximal", "Intermediate", "Distal")
_THUMB_SEGMENTS = ("Metacarpal", "Proximal", "Distal")
_FINGER_NAMES = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}


@dataclass(frozen=True)
class HumanoidBone:
    """A bone of VRM.

    Attributes:
        joint: the joint of the skeleton at which the VRM bone begins.
        turned_by: the bone of the skeleton that defines the VRM bone's rotation.
        parent: name of the parent VRM bone. Empty for the hips.
    """

    joint: int
    turned_by: int
    parent: str


@dataclass(frozen=True, eq=False)
class Humanoid:
    """The VRM bones of a skeleton.

    Attributes:
        bones: the VRM bones by name, parents before children.
        t_pose: (4,) rotation of each bone from the skeleton's rest pose to the T-pose, in the world.
        facing: (4,) rotation that makes the rest pose face +Z.
    """

    bones: dict[str, HumanoidBone]
    t_pose: dict[str, Float]
    facing: Float


def humanoid_from_skeleton(skeleton: Skeleton | None, where: str) -> Humanoid:
    """Returns the VRM bones of a skeleton.

    Args:
        where: name of the character, for error messages.

    Raises:
        InputError: if the names of the joints do not identify all bones that VRM requires.
    """
    remedy = "Export a .glb file instead, or use the joint names of Mixamo, VRM or Unreal."
    human = None if skeleton is None else find_human_joints(skeleton)
    if skeleton is None or human is None:
        problem = "the character is not a humanoid: its joint names do not identify two arms and two legs"
        raise InputError(problem, where=where, remedy=remedy)
    if not human.head_knots:
        raise InputError(
            "the character is not a humanoid: its joint names do not identify a head",
            where=where,
            remedy=remedy,
        )
    bones = _humanoid_bones(skeleton, human)
    facing = from_rotation_vector(np.array([0.0, -find_facing(skeleton), 0.0]))
    return Humanoid(bones, _t_pose(skeleton, bones, facing), facing)


def _humanoid_bones(skeleton: Skeleton, human: HumanJoints) -> dict[str, HumanoidBone]:
    """Returns the bones by name, parents before children."""
    bones = dict[str, HumanoidBone]()

    def add(name: str, joint: int, toward: int, parent: str) -> None:
        bones[name] = HumanoidBone(joint, _bone_toward(skeleton, joint, toward), parent)

    add("hips", human.hips, human.legs[0].knots[0], "")
    if human.hips == 0:
        bones["hips"] = HumanoidBone(0, 0, "")
    # The spine consists of the joints after the hips, up to the joint that the arms share.
    spine = [*skeleton.path(human.hips, human.chest)[1:]] or [human.hips]
    spine_bones = spine if len(spine) < 3 else [spine[0], spine[1], spine[-1]]
    trunk = [*zip(_SPINE_NAMES, spine_bones, strict=False)]
    if len(human.head_knots) > 1:
        trunk.append(("neck", human.head_knots[0]))
    trunk.append(("head", human.head_knots[-1]))
    above = "hips"
    for (name, joint), toward in zip(
        trunk, [*(joint for _, joint in trunk[1:]), human.head[-1]], strict=True
    ):
        add(name, joint, toward, above)
        above = name
    chest = _SPINE_NAMES[len(spine_bones) - 1]
    for side, arm, leg in zip(("left", "right"), human.arms, human.legs, strict=True):
        collar = skeleton.path(human.chest, arm.knots[0])[1:-1]
        if collar:
            add(f"{side}Shoulder", collar[0], arm.knots[0], chest)
        _add_limb(bones, skeleton, arm, (f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand"))
        bones[f"{side}UpperArm"] = replace(
            bones[f"{side}UpperArm"], parent=f"{side}Shoulder" if collar else chest
        )
        _add_limb(bones, skeleton, leg, (f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot"))
        if leg.tip >= 0 and skeleton.children[leg.tip]:
            add(f"{side}Toes", leg.tip, skeleton.children[leg.tip][0], f"{side}Foot")
        for finger, chain in finger_joints(skeleton, arm.knots[2]).items():
            parent = f"{side}Hand"
            for segment, joint, toward in zip(
                _THUMB_SEGMENTS if finger == "thumb" else _FINGER_SEGMENTS,
                chain[1:],
                (*chain[2:], chain[-1]),
                strict=False,
            ):
                name = f"{side}{_FINGER_NAMES[finger]}{segment}"
                add(name, joint, toward, parent)
                parent = name
    return bones


def _add_limb(
    bones: dict[str, HumanoidBone], skeleton: Skeleton, limb: HumanLimb, names: tuple[str, str, str]
) -> None:
    """Adds the three bones of an arm or a leg. The hips become the parent of the first bone."""
    _, middle, end = limb.knots
    parent = "hips"
    for name, joint, toward in zip(names, limb.knots, (middle, end, limb.tip), strict=True):
        turned_by = _bone_toward(skeleton, joint, toward if toward >= 0 else joint)
        bones[name] = HumanoidBone(joint, turned_by, parent)
        parent = name


def _bone_toward(skeleton: Skeleton, joint: int, toward: int) -> int:
    """Returns the bone that begins at a joint and leads to another one.

    If no bone begins there, returns the bone that ends there.
    """
    if toward == joint:
        return joint
    path = skeleton.path(joint, toward)
    return int(path[1]) if skeleton.parents[path[1]] == joint else joint


def _t_pose(skeleton: Skeleton, bones: dict[str, HumanoidBone], facing: Float) -> dict[str, Float]:
    """Returns the rotation (4,) of each bone from the rest pose to the T-pose."""
    positions = rotate(facing, skeleton.positions)
    rotations = dict[str, Float]()
    for name, bone in bones.items():
        end = _LIMB_ENDS.get(name.removeprefix("left").removeprefix("right"))
        side = "left" if name.startswith("left") else "right"
        if end is not None:
            target_direction = _LEFT_DIRECTION if side == "left" else -_LEFT_DIRECTION
            direction = unit(positions[bones[f"{side}{end}"].joint] - positions[bone.joint])
            rotations[name] = multiply(
                swing(direction, _DOWN_DIRECTION if "Leg" in name else target_direction), facing
            )
        elif name.endswith("Hand") or "Hand" in bone.parent or _is_finger(bone.parent):
            rotations[name] = rotations[bone.parent]
        else:
            rotations[name] = facing
    return rotations


def _is_finger(name: str) -> bool:
    return any(finger in name for finger in _FINGER_NAMES.values())
