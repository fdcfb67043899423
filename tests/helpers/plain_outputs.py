"""Slow, readable reference implementations of the fast parts of live outputs. They use NumPy and Python
objects, one step at a time.
"""

from __future__ import annotations

import numpy as np

from enliven.document import BOX
from enliven.person import (
    BODY_BONE_NAMES,
    ROKOKO_BONES,
    ROKOKO_JOINTS,
    ROKOKO_T_POSE,
    Body,
    HumanPose,
    Joint,
    orientations_of_joints,
    unity_position,
    unity_rotation,
)
from enliven.rotation import IDENTITY, conjugate, from_matrix, from_rotation_vector, multiply, rotate, slerp

END_JOINTS = {
    "Hips": "HIP_CENTER",
    "Spine": "SPINE",
    "Chest": "SHOULDER_CENTER",
    "Neck": "HEAD",
    "Head": "HEAD",
    "Shoulder": "SHOULDER",
    "UpperArm": "ELBOW",
    "LowerArm": "WRIST",
    "Hand": "HAND",
    "UpperLeg": "KNEE",
    "LowerLeg": "ANKLE",
    "Foot": "FOOT",
    "Toes": "FOOT",
}
"""The joint that gives each bone of a performer its rotation."""
BEGIN_JOINTS = {
    "Shoulder": "SHOULDER",
    "UpperArm": "SHOULDER",
    "LowerArm": "ELBOW",
    "Hand": "WRIST",
    "UpperLeg": "HIP",
    "LowerLeg": "KNEE",
    "Foot": "ANKLE",
    "Toes": "FOOT",
}
"""The joint at which each bone of a limb begins."""


def plain_human(body: Body) -> HumanPose:
    """Returns the bones of a performer, one by one."""
    joints = body.joints
    orientations = orientations_of_joints(joints) if body.orientations is None else body.orientations
    positions, turns = {}, {}
    neck = joints[Joint.SHOULDER_CENTER]
    for name in BODY_BONE_NAMES:
        side = next((side for side in ("Left", "Right") if name.startswith(side)), "")
        bone = name.removeprefix(side)
        suffix = f"_{side.upper()}" if side else ""
        turn = orientations[Joint[END_JOINTS[bone] + suffix]]
        if bone in ("UpperArm", "LowerArm", "Hand"):
            quarter = np.pi / 2 if side == "Left" else -np.pi / 2
            turn = multiply(turn, conjugate(from_rotation_vector(np.array([0.0, 0.0, quarter]))))
        turns[name] = turn
        if side:
            positions[name] = joints[Joint[BEGIN_JOINTS[bone] + suffix]]
            if bone == "Shoulder":
                positions[name] = neck + 0.25 * (positions[name] - neck)
    turns["Spine"] = slerp(turns["Hips"], turns["Chest"], np.array(0.5))
    turns["Neck"] = slerp(turns["Chest"], turns["Head"], np.array(0.5))
    positions["Hips"], positions["Chest"], positions["Neck"] = (
        joints[Joint.HIP_CENTER],
        joints[Joint.SPINE],
        neck,
    )
    positions["Spine"] = 0.5 * (joints[Joint.HIP_CENTER] + joints[Joint.SPINE])
    positions["Head"] = neck + 0.5 * (joints[Joint.HEAD] - neck)
    order = BODY_BONE_NAMES
    return HumanPose(
        "", order, np.array([positions[name] for name in order]), np.array([turns[name] for name in order])
    )


def plain_rows(frame) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Returns the (3,) position and (4,) rotation of every object on a stage, by name."""
    rows = {}
    for pose in frame.poses:
        info = frame.characters[pose.character]
        pivots, middle = info.character.pivots, info.character.pivots.mean(0, dtype=float)
        if info.character.kind == "graph":
            centre = pose.positions.mean(0, dtype=float)
            rows[pose.character] = centre, from_matrix((pose.positions - centre).T @ (pivots - middle))
        else:
            turn = from_matrix(pose.linear[0])
            rows[pose.character] = pose.positions[0] + rotate(turn, middle - pivots[0]), turn
    for pose in frame.poses:
        names = frame.characters[pose.character].character.names or ()
        for bone, position, linear in zip(names, pose.positions, pose.linear, strict=bool(names)):
            rows[f"{pose.character}/{bone}"] = position, from_matrix(linear)
    for number, body in frame.performers.items():
        turn = IDENTITY if body.orientations is None else body.orientations[Joint.HIP_CENTER]
        rows[f"performer-{number}"] = body.joints[Joint.HIP_CENTER], turn
    if frame.props is not None:
        for k, number in enumerate(frame.props.ids):
            rows[f"prop-{number}"] = frame.props.positions[k], frame.props.turns[k]
    return rows


def unity_numbers(position, turn) -> list[float]:
    """Returns the seven numbers of a placement in Unity's axes."""
    return [*unity_position(position).tolist(), *unity_rotation(turn).tolist()]


def plain_vmc(frame, source: str = "") -> dict[str, dict[str, list[float]]]:
    """Returns the VMC numbers of the bones and of the trackers, by name."""
    human = frame.find_human(source)
    bones = {}
    if human is not None:
        for name, position, turn in zip(human.bones, *human.local(), strict=True):
            bones[name] = unity_numbers(position, turn)
    own = "" if human is None else human.name
    rows = {name: row for name, row in plain_rows(frame).items() if own not in (name, name.split("/")[0])}
    return {"bones": bones, "trackers": {name: unity_numbers(*row) for name, row in rows.items()}}


def plain_rokoko(frame) -> dict:
    """Returns the scene object of a Rokoko packet, without its time."""
    rows = plain_rows(frame)
    actors = []
    for human in frame.humans:
        body = {}
        for joint, bone, rest in zip(ROKOKO_JOINTS, ROKOKO_BONES, ROKOKO_T_POSE, strict=True):
            number = human.bones.index(_find_existing(bone, human.bones))
            body[joint] = _placement(human.positions[number], multiply(human.turns[number], rest))
        heights = [joint["position"]["y"] for joint in body.values()]
        size = {
            "totalHeight": max(heights) - min(heights),
            "hipHeight": body["hip"]["position"]["y"] - min(heights),
        }
        actors.append({"name": human.name, "dimensions": size, "body": body})
    characters, props = [], []
    for pose in frame.poses:
        info = frame.characters[pose.character]
        if info.character.names is None:
            props.append({"name": pose.character, **_placement(*rows[pose.character])})
        elif info.humanoid is None:
            names = info.character.names
            joints = [{"name": name, **_placement(*rows[f"{pose.character}/{name}"])} for name in names]
            characters.append({"name": pose.character, "joints": joints})
    if frame.props is not None:
        for number, shape in zip(frame.props.ids, frame.props.shapes, strict=True):
            name = f"{'box' if shape == BOX else 'ball'}-{number}"
            props.append({"name": name, **_placement(*rows[f"prop-{number}"])})
    return {"actors": actors, "characters": characters, "props": props}


def _find_existing(bone: str, bones) -> str:
    """Returns the bone that replaces a missing one."""
    while bone not in bones:
        side = "Left" if bone.startswith("Left") else "Right"
        others = {"Chest": "Spine", "Spine": "Hips", "Neck": "Head", "Head": "Chest"}
        bone = f"{side}Foot" if bone.endswith("Toes") else others.get(bone, "Chest")
    return bone


def _placement(position, turn) -> dict[str, dict[str, float]]:
    numbers = unity_numbers(position, turn)
    return {
        "position": dict(zip("xyz", numbers[:3], strict=True)),
        "rotation": dict(zip("xyzw", numbers[3:], strict=True)),
    }
