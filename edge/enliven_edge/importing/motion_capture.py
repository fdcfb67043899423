"""Reads motion captures as bodies.

The captured person is the performer. Its size and the frame rate are those of the capture.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import decode_text
from enliven.formats.motion.added_pose import remove_added_poses
from enliven.formats.motion.capture import UNITS, Capture, guess_unit
from enliven.formats.motion.expmap import COLUMNS
from enliven.frames import BodyFrame
from enliven.motion_clips.capture_limbs import find_limb_rotations, path_midpoint
from enliven.motion_clips.capture_roles import JointRoles, find_roles
from enliven.motion_clips.capture_upright import leg_length, read_capture, turn_upright
from enliven.person import Body, J, Joint, Limb
from enliven.rotation import from_matrix
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    FileReader,
    ImportOptions,
    are_numbers,
    first_lines,
    read_head,
)
from enliven_edge.importing.skeletons import TRACKED, SkeletonMoment, frames_in_world

_BONE_LIMBS = (
    Limb.PELVIS, Limb.ABDOMEN, Limb.CHEST, Limb.SKULL,
    Limb.CHEST, Limb.UPPER_ARM_LEFT, Limb.FOREARM_LEFT, Limb.HAND_LEFT,
    Limb.CHEST, Limb.UPPER_ARM_RIGHT, Limb.FOREARM_RIGHT, Limb.HAND_RIGHT,
    Limb.PELVIS, Limb.THIGH_LEFT, Limb.SHANK_LEFT, Limb.FOOT_LEFT,
    Limb.PELVIS, Limb.THIGH_RIGHT, Limb.SHANK_RIGHT, Limb.FOOT_RIGHT,
)  # fmt: skip
"""(20,) the limb that gives the orientation of the bone ending at each joint."""
_HEAD_CENTRE = 0.075
"""Distance in metres along the skull from the head's joint to the middle of the head. Sensors report that
point as the head."""


class MotionCaptureReader(FileReader):
    """Reads a BVH file, or CMU's exponential maps.

    Joints are matched by name, and the unit is guessed from the leg length.

    Left and right, heading and position are the same as in the file. Joints and orientations of bones have
    confidence 1, because a motion capture contains no confidence.
    """

    name = "motion-capture"
    description = "motion capture: BVH of any convention, or CMU exponential maps"
    note = "the unit is guessed from the leg length; every joint counts as tracked"

    def matches(self, path: Path) -> bool:
        """Returns True for a BVH file or a table of exponential maps."""
        return _is_bvh(path) or _is_expmap(path)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        """Yields one body for each frame, at the capture's own rate unless ``options.fps`` sets another one.

        Poses that were added before or after the motion, such as a T-pose, are removed. ``options.note``
        reports this.

        Raises:
            InputError: if the file cannot be read, or its joints are not those of a human body.
        """
        path = self.choose_file(paths)
        capture = remove_added_poses(read_capture(path))
        for note in capture.notes:
            options.note(note)
        try:
            roles = find_roles(capture)
        except InputError as error:
            raise InputError(error.what, where=str(path), remedy=error.remedy) from None
        joints, orientations = bodies_from_capture(capture, roles)
        seconds = 1.0 / options.fps if options.fps else capture.seconds
        sure = np.full(J, TRACKED)
        moments = [
            SkeletonMoment(round(n * seconds * 1e9), [Body(0, xyz, sure, orientation)])
            for n, (xyz, orientation) in enumerate(zip(joints, orientations, strict=True))
        ]
        return frames_in_world(moments, options.device or "mocap", np.eye(3), str(path))


def bodies_from_capture(capture: Capture, roles: JointRoles) -> tuple[Float, Float]:
    """Returns the joints (F, 20, 3) in metres and the orientations (F, 20, 4), +Y up.

    The input is a capture in its own unit and axes.
    """
    capture = turn_upright(capture)
    p = capture.positions
    metres = UNITS[guess_unit(leg_length(capture, roles))]
    limbs, _ = find_limb_rotations(capture, roles)
    joints = np.empty((capture.frames, J, 3))
    hips, shoulders = p[:, list(roles.hips)].mean(1), p[:, list(roles.shoulders)].mean(1)
    trunk = np.concatenate([hips[:, None], p[:, list(roles.spine)], shoulders[:, None]], 1)
    joints[:, Joint.HIP_CENTER] = p[:, roles.root]
    joints[:, Joint.SPINE] = path_midpoint(trunk)
    joints[:, Joint.SHOULDER_CENTER] = shoulders
    joints[:, Joint.HEAD] = p[:, roles.head] + _HEAD_CENTRE / metres * limbs[:, Limb.SKULL, :, 1]
    sides = (roles.shoulders, roles.elbows, roles.wrists, roles.tips)
    _fill_limbs(joints, p, (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT), sides)
    _fill_limbs(
        joints, p, (Joint.HIP_LEFT, Joint.HIP_RIGHT), (roles.hips, roles.knees, roles.ankles, roles.toes)
    )
    return metres * joints, from_matrix(limbs[:, list(_BONE_LIMBS)])


def _fill_limbs(
    joints: Float, positions: Float, first: tuple[Joint, Joint], chain: tuple[tuple[int, int], ...]
) -> None:
    """Fills both limbs of a pair, each from its first joint."""
    for side in (0, 1):
        for k, pair in enumerate(chain):
            joints[:, first[side] + k] = positions[:, pair[side]]


def _is_bvh(path: Path) -> bool:
    return decode_text(read_head(path, 1024)).lstrip().upper().startswith("HIERARCHY")


def _is_expmap(path: Path) -> bool:
    rows = [line.split(",") for line in first_lines(read_head(path), 1)]
    return bool(rows) and len(rows[0]) == COLUMNS and are_numbers(rows[0])
