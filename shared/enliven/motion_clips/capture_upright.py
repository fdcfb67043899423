"""Rotates motion captures upright and determines their unit. Import, retargeting, export and studio use this
module.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import decode_text, open_file
from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import UNITS, Capture, guess_unit
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.capture_roles import JointRoles, find_roles
from enliven.rotation import unit

_Y_FROM = {
    "+Y": np.eye(3),
    "-Y": np.diag([1.0, -1.0, -1.0]),
    "+Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "+X": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "-X": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""For each possible up axis of a file, the rotation (3, 3) that maps it to +Y."""
_HEAD_BYTES = 1024
"""Number of bytes at the start of a file in which its first word is searched."""
_MIN_ALIGNMENT = 0.8
"""Minimum cosine of the angle between the up axis and the upright direction of the rest pose (or of an
animal's legs)."""
_MIN_REST_HEIGHT = 0.8
"""Minimum height of a standing rest pose, relative to the body's height in the frames."""
_MIN_STEADINESS = 0.7
"""Minimum mean cosine of the angle between the body's direction and its median. Below it, the up direction is
determined from the rest pose instead of the frames, for example for a person who turns somersaults."""
_FLOOR_TOLERANCE = 0.05
"""Maximum distance of the lowest joint from a floor at zero, as a fraction of the body's length. It allows
for markers some centimetres above the floor."""
_FOOT_NAME_PATTERN = re.compile(r"foot|ankle|paw|hoof|feet", re.IGNORECASE)
"""Pattern of the names of a leg's lowest joint, also in captures of animals."""


def read_capture(path: Path) -> Capture:
    """Reads a motion capture (BVH or CMU's exponential maps), and rotates it upright (+Y up). Positions stay
    in the unit of the file.

    Raises:
        InputError: if the file cannot be read or is damaged.
    """
    with open_file(path) as file:
        is_bvh = decode_text(file.read(_HEAD_BYTES)).lstrip().upper().startswith("HIERARCHY")
    capture = read_bvh(path) if is_bvh or path.suffix.lower() == ".bvh" else read_expmap(path)
    upright_capture = turn_upright(capture)
    if upright_capture is capture:
        return capture
    note = f"the {_up_axis(capture)} axis of the file points up, so the motion was turned upright"
    return replace(upright_capture, notes=(*capture.notes, note))


def turn_upright(capture: Capture) -> Capture:
    """Rotates the capture so that +Y is up. Returns the same object if it is already upright.

    The coordinate frames of the joints are rotated too. So the result is the same as for a file that was
    written with +Y up, and zero rotations still mean the zero pose.
    """
    up = _up_axis(capture)
    if up == "+Y":
        return capture
    rotation_matrix = _Y_FROM[up]
    return replace(
        capture,
        positions=capture.positions @ rotation_matrix.T,
        rotations=rotation_matrix @ capture.rotations @ rotation_matrix.T,
    )


def leg_length(capture: Capture, roles: JointRoles) -> float:
    """Returns the length of the left leg from hip to ankle in the file's unit, median over the frames."""
    p = capture.positions
    upper = np.linalg.norm(p[:, roles.hips[0]] - p[:, roles.knees[0]], axis=-1)
    lower = np.linalg.norm(p[:, roles.knees[0]] - p[:, roles.ankles[0]], axis=-1)
    return float(np.median(upper + lower))


def metres_per_unit_from_legs(capture: Capture) -> float | None:
    """Returns the length in metres of the file's unit, estimated from the length of a person's legs. Returns
    None if no legs are found by name.
    """
    roles = _joint_roles(capture)
    return None if roles is None else UNITS[guess_unit(leg_length(capture, roles))]


def _joint_roles(capture: Capture) -> JointRoles | None:
    try:
        return find_roles(capture)
    except InputError:
        return None


def _up_axis(capture: Capture) -> str:
    """Returns the axis of a file that points up, such as "+Z".

    It is the axis along which the head is above the ankles or, for an animal, along which the legs stand. If
    a person crawls or lies all the time, the rest pose may stand along another axis. The axis of the rest
    pose is used if the lowest joint is at zero only along this axis.
    """
    roles = _joint_roles(capture)
    ups = _compute_up_vectors(capture, roles, capture.positions)
    moving = np.median(ups, axis=0)
    if not moving.any():
        return "+Y"
    axis, is_clear = _find_nearest_axis(moving)
    is_steady = float(np.mean(unit(ups), axis=0) @ unit(moving)) > _MIN_STEADINESS
    if roles is None and not is_clear:
        return "+Y"
    rest_up = _compute_up_vectors(capture, roles, _zero_pose(capture)[None])[0]
    resting, stands = _find_nearest_axis(rest_up)
    stands = stands and np.linalg.norm(rest_up) > _MIN_REST_HEIGHT * np.linalg.norm(moving)
    if not stands or resting == axis:
        return axis
    is_lying = _has_floor(capture, resting) and not _has_floor(capture, axis)
    return resting if is_lying or not is_steady else axis


def _compute_up_vectors(capture: Capture, roles: JointRoles | None, positions: Float) -> Float:
    """Returns vectors (F, 3) that point up: from the ankles to the head, or along an animal's legs. They are
    zero if unknown.
    """
    if roles is not None:
        return np.asarray(positions[:, roles.head] - positions[:, list(roles.ankles)].mean(1))
    parents = np.array(capture.parents)
    feet = [
        j
        for j, name in enumerate(capture.names)
        if _FOOT_NAME_PATTERN.search(name) and not name.endswith(" end")
    ]
    legs = [(parents[parents[j]], j) for j in feet if parents[j] >= 0 and parents[parents[j]] >= 0]
    if not legs:
        return np.zeros((len(positions), 3))
    return np.asarray(np.mean([positions[:, top] - positions[:, foot] for top, foot in legs], axis=0))


def _find_nearest_axis(up: Float) -> tuple[str, bool]:
    """Returns the axis nearest to a vector, and True if the choice is unambiguous. Otherwise returns +Y or
    -Y, and False.
    """
    length = np.abs(up)
    k = 1 if length[1] >= length.max() else int(np.argmax(length))
    return f"{'+-'[int(up[k] < 0)]}{'XYZ'[k]}", bool(np.abs(unit(up)[k]) > _MIN_ALIGNMENT)


def _zero_pose(capture: Capture) -> Float:
    """Returns the joint positions (N, 3) in the zero pose (all rotations zero), with the root at the
    origin."""
    positions = np.zeros((len(capture.parents), 3))
    for j, parent in enumerate(capture.parents):
        if parent >= 0:
            offset = capture.positions[:, j] - capture.positions[:, parent]
            positions[j] = positions[parent] + np.median(
                np.einsum("fji,fj->fi", capture.rotations[:, parent], offset), axis=0
            )
    return positions


def _has_floor(capture: Capture, axis: str) -> bool:
    """Returns True if the lowest joint is near zero along an axis in the frames."""
    heights = capture.positions[:, :, "XYZ".index(axis[1])] * (1.0 if axis[0] == "+" else -1.0)
    length = float(np.median(np.ptp(capture.positions, axis=1).max(1)))
    return bool(abs(np.percentile(heights.min(1), 10)) < _FLOOR_TOLERANCE * length)
