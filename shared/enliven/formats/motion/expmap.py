"""Reads CMU motions stored as tables of exponential maps: 117 comma-separated numbers per frame, 120 frames a
second.

The first three numbers are the root's position. The others are 38 rotation vectors. The files use the row
vector convention, so a joint's rotation is the inverse of the rotation by its vector. In the files, the
root's Euler angles Z, Y, X were composed in the wrong order Z, X, Y. The reader decomposes the rotation and
composes the angles in the correct order.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import decode_text, read_file
from enliven.formats.motion.bvh import axis_rotations
from enliven.formats.motion.capture import Capture, forward_kinematics
from enliven.rotation import from_rotation_vector, to_matrix

COLUMNS = 117
"""Number of values in a frame: 3 for the root's position, and 3 for each of 38 joints."""
SECONDS = 1.0 / 120.0
"""Frame time, in seconds. The files do not contain the frame rate, but CMU's captures have 120 Hz."""

_JOINTS: tuple[tuple[str, int, tuple[float, float, float]], ...] = (
    ("Hips", -1, (0.0, 0.0, 0.0)),
    ("LHipJoint", 0, (0.0, 0.0, 0.0)),
    ("LeftUpLeg", 1, (1.65674, -1.80282, 0.62477)),
    ("LeftLeg", 2, (2.5972, -7.13576, 0.0)),
    ("LeftFoot", 3, (2.49236, -6.8477, 0.0)),
    ("LeftToeBase", 4, (0.19704, -0.54136, 2.14581)),
    ("LeftToeBase end", 5, (0.0, 0.0, 1.11249)),
    ("RHipJoint", 0, (0.0, 0.0, 0.0)),
    ("RightUpLeg", 7, (-1.6107, -1.80282, 0.62476)),
    ("RightLeg", 8, (-2.59502, -7.12977, 0.0)),
    ("RightFoot", 9, (-2.4678, -6.78024, 0.0)),
    ("RightToeBase", 10, (-0.23024, -0.63258, 2.13368)),
    ("RightToeBase end", 11, (0.0, 0.0, 1.11569)),
    ("LowerBack", 0, (0.0, 0.0, 0.0)),
    ("Spine", 13, (0.01961, 2.0545, -0.14112)),
    ("Spine1", 14, (0.01021, 2.06436, -0.05921)),
    ("Neck", 15, (0.0, 0.0, 0.0)),
    ("Neck1", 16, (0.00713, 1.56711, 0.14968)),
    ("Head", 17, (0.03429, 1.56041, -0.10006)),
    ("Head end", 18, (0.01305, 1.6256, -0.05265)),
    ("LeftShoulder", 15, (0.0, 0.0, 0.0)),
    ("LeftArm", 20, (3.54205, 0.90436, -0.17364)),
    ("LeftForeArm", 21, (4.86513, 0.0, 0.0)),
    ("LeftHand", 22, (3.35554, 0.0, 0.0)),
    ("LeftFingerBase", 23, (0.0, 0.0, 0.0)),
    ("LeftHandIndex1", 24, (0.66117, 0.0, 0.0)),
    ("LeftHandIndex1 end", 25, (0.53306, 0.0, 0.0)),
    ("LThumb", 23, (0.0, 0.0, 0.0)),
    ("LThumb end", 27, (0.5412, 0.0, 0.5412)),
    ("RightShoulder", 15, (0.0, 0.0, 0.0)),
    ("RightArm", 29, (-3.49802, 0.75994, -0.32616)),
    ("RightForeArm", 30, (-5.02649, 0.0, 0.0)),
    ("RightHand", 31, (-3.36431, 0.0, 0.0)),
    ("RightFingerBase", 32, (0.0, 0.0, 0.0)),
    ("RightHandIndex1", 33, (-0.73041, 0.0, 0.0)),
    ("RightHandIndex1 end", 34, (-0.58887, 0.0, 0.0)),
    ("RThumb", 32, (0.0, 0.0, 0.0)),
    ("RThumb end", 36, (-0.59786, 0.0, 0.59786)),
)
"""Name, parent and offset (in CMU units) of each joint, in the order of the exponential maps."""


def read_expmap(path: Path | str, *, repairs_root: bool = True) -> Capture:
    """Reads a table of exponential maps.

    Args:
        repairs_root: True corrects the order of the root's Euler angles. False uses the file's rotation
            unchanged.

    Raises:
        InputError: if the file cannot be read or a line is wrong. The message contains the line number.
    """
    path = Path(path)
    lines = decode_text(read_file(path)).split("\n")
    rows = np.array([_row_values(line, number, path) for number, line in enumerate(lines, 1) if line.strip()])
    if len(rows) == 0:
        raise InputError("the file has no frames", where=str(path))
    maps = rows[:, 3:].reshape(len(rows), len(_JOINTS), 3)
    rotations = to_matrix(from_rotation_vector(-maps))
    if repairs_root:
        rotations[:, 0] = _correct_rotations(rotations[:, 0])
    offsets = np.tile(np.array([offset for _, _, offset in _JOINTS]), (len(rows), 1, 1))
    offsets[:, 0] = rows[:, :3]
    parents = tuple(parent for _, parent, _ in _JOINTS)
    positions, world = forward_kinematics(parents, offsets, rotations)
    return Capture(tuple(name for name, _, _ in _JOINTS), parents, positions, world, SECONDS)


def _row_values(line: str, number: int, path: Path) -> list[float]:
    location = f"{path}, line {number}"
    try:
        values = [float(word) for word in line.split(",")]
    except ValueError:
        raise InputError("a value is not a number", where=location) from None
    if len(values) != COLUMNS or not np.isfinite(values).all():
        raise InputError(
            f"the line has {len(values)} numbers, expected {COLUMNS} finite numbers", where=location
        )
    return values


def _correct_rotations(wrong: Float) -> Float:
    """Corrects the order of Euler rotations: decomposes ``wrong`` (F, 3, 3) = Rz Rx Ry, and returns Rz Ry Rx
    (F, 3, 3).
    """
    x = np.arcsin(np.clip(wrong[:, 2, 1], -1.0, 1.0))
    y = np.arctan2(-wrong[:, 2, 0], wrong[:, 2, 2])
    z = np.arctan2(-wrong[:, 0, 1], wrong[:, 1, 1])
    return np.asarray(axis_rotations(2, z) @ axis_rotations(1, y) @ axis_rotations(0, x))
