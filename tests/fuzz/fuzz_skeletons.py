"""Seeds of the skeleton files of other programs: one small file of each layout, with a standing person."""

from __future__ import annotations

import json

import numpy as np

from enliven.person import Joint
from enliven_edge.importing.kinect_texts import MSR_ORDER
from enliven_edge.importing.skeletons import KINECT2_NAMES, KINECT2_ORDER

_FRAMES = 2
"""Frames of each file."""
_ANGLES = np.arange(20.0)
_JOINTS = np.stack([0.3 * np.sin(_ANGLES), 0.6 * np.cos(_ANGLES), 2.5 + 0.01 * _ANGLES], 1)
"""(20, 3) metres, joints in the frame of a Kinect."""


def skeleton_files() -> dict[str, tuple[str, bytes]]:
    """Returns the suffix and the content of a file for each reader of skeletons, by the reader's name."""
    files = {
        "labanotation": (".csv", _labanotation()),
        "multitrack": (".csv", _multitrack()),
        "msr-action3d": (".txt", _msr_action3d()),
        "kinect-gait": (".txt", _kinect_gait()),
        "flow-room": (".json", _flow_room()),
        "body-scanner": (".csv", _body_scanner()),
    }
    return {name: (suffix, text.encode()) for name, (suffix, text) in files.items()}


def _labanotation() -> str:
    """Returns rows of a time and 25 joints with their tracking states."""
    joints = np.full((25, 4), 2.0)
    joints[list(KINECT2_ORDER), :3] = _JOINTS
    return "".join(f"{330000 * k},{_row(joints)},\n" for k in range(_FRAMES))


def _multitrack() -> str:
    """Returns a table with a header, one row for each person and Kinect."""
    keys = "Study_Id, Kinect_Config, Scenario_Id, Tracker_Time, Person_Id, Skeleton_Id, Kinect_Id"
    header = keys + "".join(f", {name}_{axis}" for name in KINECT2_NAMES for axis in "XYZ")
    rows = [f"3, 2, 1, {35 * k}, {who}, 0, a, {_row(_JOINTS)}" for k in range(_FRAMES) for who in range(2)]
    return "\n".join([header, *rows]) + "\n"


def _msr_action3d() -> str:
    """Returns 20 rows of a frame: x, y, z and confidence."""
    rows = np.column_stack([_JOINTS[list(MSR_ORDER)], np.ones(20)])
    return "".join("  ".join(f"{value:.7e}" for value in row) + "\n" for row in rows) * _FRAMES


def _kinect_gait() -> str:
    """Returns a row with the name of each joint. A frame begins with the head."""
    order = [Joint.HEAD, *(joint for joint in Joint if joint != Joint.HEAD)]
    names = [joint.name.replace("_", "-").title().replace("Hip-Center", "Hip-centro") for joint in order]
    rows = (f"{name};" + ";".join(map(str, _JOINTS[joint])) for name, joint in zip(names, order, strict=True))
    return "".join(f"{row}\n" for row in rows) * _FRAMES


def _flow_room() -> str:
    """Returns the frames as lists of bodies with 21 joints in pixels of the depth image."""
    points = [{"x": 200.0 + k, "y": 100.0 + 9 * k, "z": 100.0 + k} for k in range(21)]
    return json.dumps([[{"bodyIndex": 0, "trackingId": "720", "joints": points}]] * _FRAMES)


def _body_scanner() -> str:
    """Returns one frame of a sensor that looks down by an angle."""
    rows = [f"{name},{_row(joint)}" for name, joint in zip(KINECT2_NAMES, _JOINTS, strict=True)]
    return "\n".join(["Joints,X,Y,Z", "Degree,13.5,13.5,13.5", *rows]) + "\n"


def _row(numbers: np.ndarray) -> str:
    return ",".join(map(str, numbers.ravel()))
