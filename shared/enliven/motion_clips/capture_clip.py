"""Converts motion captures to clips in metres: rest pose, moving root, bone lengths and unit.

    clip_of_capture(capture, id, *, rest="auto", unit=None) -> Clip

Clips are in metres, +Y up. Their quaternions have consistent signs from frame to frame.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Skeleton
from enliven.errors import InputError
from enliven.formats.motion.capture import UNITS, Capture, guess_unit
from enliven.motion_clips.capture_upright import metres_per_unit_from_legs, turn_upright
from enliven.rotation import conjugate, from_matrix, multiply, remove_sign_jumps, rotate

_MIN_STANDING_HEIGHT_FRACTION = 0.9
"""Minimum height of a standing zero pose, as a fraction of the body's height in the frames."""
_MIN_ROOT_MOTION_FRACTION = 0.002
"""Minimum motion of the moving root relative to its parent, as a fraction of the extent. Smaller motions are
rounding errors."""
_HIP_TO_ANKLE = 0.9
"""Typical leg length as a fraction of the root's height above the lowest joint, for guessing the unit."""


def clip_of_capture(
    capture: Capture, id: str, *, rest: str | int = "auto", unit: str | float | None = None
) -> Clip:
    """Returns the motion of a file as a clip in metres.

    A capture in which +Y does not point up is rotated upright. Visible translations of joints relative to
    their parents become the clip's offsets. A static joint above the moving root (for example a point on the
    floor) is removed.

    Args:
        rest: the rest pose: "zero" (all rotations are zero), "first" (the first frame), a frame number, or
            "auto". "auto" means "zero" if the zero pose is as tall as the body in the frames, and otherwise
            "first".
        unit: a name in ``UNITS``, or metres per unit. None guesses the unit from the leg length or, if no
            legs are found, from the height of the root above the lowest joint.

    Raises:
        InputError: if the tree has two roots, or a frame or unit does not exist.
    """
    capture = turn_upright(capture)
    names, parents, positions, rotations = find_moving_root(capture, id)
    offsets = median_links(parents, positions, rotations)
    turns = from_matrix(rotations)
    if rest == "auto":
        rest = "zero" if is_zero_pose_standing(parents, offsets, positions) else "first"
    if rest == "zero":
        at_rest, frame_turns = (
            zero_pose(parents, offsets, positions),
            np.tile([1.0, 0, 0, 0], (len(names), 1)),
        )
    else:
        frame = 0 if rest == "first" else rest
        if not isinstance(frame, int) or not 0 <= frame < len(positions):
            advice = f'Choose "auto", "zero", "first" or a frame from 0 to {len(positions) - 1}.'
            raise InputError(f"the rest pose {rest!r} does not exist", where=f"clip {id!r}", remedy=advice)
        at_rest = rigid_pose(parents, offsets, positions[frame], rotations[frame])
        frame_turns = turns[frame]
    if unit is None:
        unit = metres_per_unit_from_legs(capture)
    scale = metres_per_unit(unit, at_rest, f"clip {id!r}")
    # Bone j has the rotation of its parent joint. The bones that begin at the root rotate with the root.
    holds = np.array([0, *parents[1:]])
    world = multiply(turns[:, holds], conjugate(frame_turns[holds]))
    skeleton = Skeleton(names, np.array(parents, np.int32), at_rest * scale)
    translations = (
        rotate(frame_turns[holds], link_translations(parents, offsets, positions, rotations)) * scale
    )
    root = positions[:, 0] * scale
    shifts = translations if translations.any() else None
    return Clip(id, skeleton, remove_sign_jumps(world), root, capture.seconds, offsets=shifts)


def find_moving_root(capture: Capture, id: str) -> tuple[tuple[str, ...], list[int], Float, Float]:
    """Returns the capture's names, parents, positions and rotations, starting at the joint that acts as the
    moving root.
    """
    if sum(parent < 0 for parent in capture.parents) != 1 or capture.parents[0] != -1:
        raise InputError(
            "the motion capture has more than one root joint",
            where=f"clip {id!r}",
            remedy="Keep only one skeleton.",
        )
    names, parents = capture.names, list(capture.parents)
    positions, rotations = capture.positions, capture.rotations
    extent = float(np.median(np.ptp(positions, axis=1).max(1)))
    while parents.count(0) == 1 and len(names) > 2:
        local = np.einsum("fji,fj->fi", rotations[:, 0], positions[:, 1] - positions[:, 0])
        if np.ptp(local, axis=0).max() < _MIN_ROOT_MOTION_FRACTION * extent:
            break
        names, parents = names[1:], [max(parent - 1, -1) for parent in parents[1:]]
        positions, rotations = positions[:, 1:], rotations[:, 1:]
    return names, parents, positions, rotations


def median_links(parents: list[int], positions: Float, rotations: Float) -> Float:
    """Returns the median position (N, 3) over all frames of each joint in its parent's frame. The root's
    position is zero.
    """
    return np.asarray(np.median(_local_links(parents, positions, rotations), axis=0))


def link_translations(parents: list[int], offsets: Float, positions: Float, rotations: Float) -> Float:
    """Returns the translation (F, N, 3) of each joint in its parent's frame, relative to its rest offset in
    ``offsets`` (N, 3).

    It is zero for a joint that moves only by rounding errors.
    """
    translations = _local_links(parents, positions, rotations) - offsets
    extent = float(np.median(np.ptp(positions, axis=1).max(1)))
    translations[:, np.abs(translations).max((0, 2)) < _MIN_ROOT_MOTION_FRACTION * extent] = 0.0
    return translations


def _local_links(parents: list[int], positions: Float, rotations: Float) -> Float:
    """Returns the position (F, N, 3) of each joint in its parent's frame. The root's position is zero."""
    parent_joints = np.maximum(parents, 0)
    offsets = positions - positions[:, parent_joints]
    return np.asarray(np.einsum("fnji,fnj->fni", rotations[:, parent_joints], offsets))


def rigid_pose(parents: list[int], offsets: Float, positions: Float, rotations: Float) -> Float:
    """Returns the joint positions (N, 3) of one frame, computed with constant bone lengths."""
    pose = positions.copy()
    for j, parent in enumerate(parents[1:], 1):
        pose[j] = pose[parent] + rotations[parent] @ offsets[j]
    return pose


def zero_pose(parents: list[int], offsets: Float, positions: Float) -> Float:
    """Returns the joint positions (N, 3) with all rotations zero, standing on the floor at the start of the
    motion."""
    count = len(parents)
    pose = rigid_pose(parents, offsets, np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)))
    floor = np.percentile(positions[:, :, 1].min(1), 10)
    shift = np.array([positions[0, 0, 0], floor - pose[:, 1].min(), positions[0, 0, 2]])
    return np.asarray(pose + shift)


def is_zero_pose_standing(parents: list[int], offsets: Float, positions: Float) -> bool:
    """Returns True if the zero pose is about as tall as the body in the frames, and its root is at about the
    same height."""
    zero = zero_pose(parents, offsets, positions)
    lowest = positions[:, :, 1].min(1)
    frame_height, root_height = (
        np.median(positions[:, :, 1].max(1) - lowest),
        np.median(positions[:, 0, 1] - lowest),
    )
    legs = zero[0, 1] - zero[:, 1].min()
    return bool(
        np.ptp(zero[:, 1]) > _MIN_STANDING_HEIGHT_FRACTION * frame_height
        and _MIN_STANDING_HEIGHT_FRACTION * root_height
        < legs
        < root_height / _MIN_STANDING_HEIGHT_FRACTION**2
    )


def metres_per_unit(unit: str | float | None, at_rest: Float, where: str) -> float:
    """Returns the length in metres of the file's unit."""
    if unit is None:
        legs = at_rest[0, 1] - at_rest[:, 1].min()
        return UNITS[guess_unit(float(legs) * _HIP_TO_ANKLE)]
    if isinstance(unit, str):
        if unit not in UNITS:
            raise InputError(
                f"the unit {unit!r} is unknown", where=where, remedy=f"Known units: {', '.join(UNITS)}."
            )
        return UNITS[unit]
    if not 0.0 < unit < 1e6:
        raise InputError(
            f"a unit of {unit} m is not valid",
            where=where,
            remedy="Pass the length of one unit in metres, above 0.",
        )
    return float(unit)
