"""Converts joints and rotations to and from the live stream format of Rokoko Studio (JSON v3 over UDP).

Positions and rotations are in world coordinates with Unity's axes. The rotation of a joint in the stream is
its rotation since the T-pose, multiplied by the joint's rotation in the T-pose of Rokoko's skeleton.

Source of the format: the readers in Rokoko's plug-ins for Unity (JsonLiveSerializerV3.cs, Actor.cs) and for
Blender (live_data_manager.py).
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.person.unity_axes import (
    from_unity_position,
    from_unity_rotation,
    unity_position,
    unity_rotation,
)
from enliven.rotation import conjugate, multiply

ROKOKO_PORT = 14043
"""Default UDP port of Rokoko's plug-ins."""
ROKOKO_VERSION = "3,0"
"""Version in the packets of Rokoko Studio. Its first number is the version of the format."""
_HALF = float(np.sqrt(0.5))
_TRUNK = (0.0, 0.0, 1.0, 0.0)
"""Rotation (x, y, z, w) of the trunk's joints in the T-pose of Rokoko's skeleton: half a turn about Z."""
_SIDES = {
    "Left": {
        "Shoulder": (0.0, 0.0, _HALF, -_HALF),
        "Arm": (-0.5, -0.5, 0.5, -0.5),
        "Leg": (0.0, _HALF, 0.0, _HALF),
        "Foot": (0.0, _HALF, -_HALF, 0.0),
    },
    "Right": {
        "Shoulder": (0.0, 0.0, _HALF, _HALF),
        "Arm": (0.5, -0.5, 0.5, 0.5),
        "Leg": (0.0, -_HALF, 0.0, _HALF),
        "Foot": (0.0, -_HALF, _HALF, 0.0),
    },
}
"""Rotations (x, y, z, w) of the limbs' joints in the T-pose of Rokoko's skeleton, in Unity's axes, by
side."""
_ROWS: tuple[tuple[str, str, tuple[float, ...]], ...] = (
    ("hip", "Hips", (0.0, 0.0, 0.0, 1.0)),
    ("spine", "Spine", _TRUNK),
    ("chest", "Chest", _TRUNK),
    ("neck", "Neck", _TRUNK),
    ("head", "Head", _TRUNK),
    *(
        (f"{side.lower()}{joint}", f"{side}{bone}", _SIDES[side][group])
        for side in ("Left", "Right")
        for joint, bone, group in (
            ("Shoulder", "Shoulder", "Shoulder"),
            ("UpperArm", "UpperArm", "Arm"),
            ("LowerArm", "LowerArm", "Arm"),
            ("Hand", "Hand", "Arm"),
            ("UpLeg", "UpperLeg", "Leg"),
            ("Leg", "LowerLeg", "Leg"),
            ("Foot", "Foot", "Foot"),
            ("Toe", "Toes", "Foot"),
            ("ToeEnd", "Toes", "Foot"),
        )
    ),
)
"""The joints of an actor: name in the stream, bone of the humanoid, and rotation in Rokoko's T-pose."""
ROKOKO_JOINTS = tuple(name for name, _, _ in _ROWS)
"""(23,) names of the joints of an actor in the stream."""
ROKOKO_BONES = tuple(bone for _, bone, _ in _ROWS)
"""(23,) the bone of Unity's humanoid for each joint. The toes occur twice, for their start and their end."""
ROKOKO_T_POSE = from_unity_rotation(np.array([turn for _, _, turn in _ROWS]))
"""(23, 4) rotations (w, x, y, z) of the joints in the T-pose of Rokoko's skeleton, in enliven's axes."""


def rokoko_placements(positions: AnyArray, turns: AnyArray) -> Float:
    """Converts positions and rotations to the format of the stream: rows (..., 7) with position and rotation
    (x, y, z, w) in Unity's axes.

    Args:
        positions: (..., 3) metres.
        turns: (..., 4) unit quaternions (w, x, y, z).
    """
    return np.concatenate([unity_position(positions), unity_rotation(turns)], -1)


def placements_from_rokoko(placements: AnyArray) -> tuple[Float, Float]:
    """Converts rows (..., 7) of the stream to positions (..., 3) and rotations (..., 4). It is the inverse of
    :func:`rokoko_placements`.
    """
    placements = np.asarray(placements, np.float64)
    return from_unity_position(placements[..., :3]), from_unity_rotation(placements[..., 3:])


def rokoko_rotations(turns: AnyArray) -> Float:
    """Converts rotations since the T-pose to rotations (..., 23, 4) of the joints of Rokoko's skeleton."""
    return multiply(turns, ROKOKO_T_POSE)


def rotations_from_rokoko(turns: AnyArray, joints: AnyArray) -> Float:
    """Converts rotations of joints of Rokoko's skeleton to rotations (J, 4) since the T-pose.

    Args:
        turns: (J, 4) unit quaternions (w, x, y, z).
        joints: (J,) numbers in :data:`ROKOKO_JOINTS`.
    """
    return multiply(turns, conjugate(ROKOKO_T_POSE[joints]))
