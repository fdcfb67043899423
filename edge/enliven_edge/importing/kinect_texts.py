"""Reads skeletons of one person from text files of Kinect programs and data sets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.person import Body, Joint
from enliven_edge.importing.base import (
    ImportOptions,
    are_numbers,
    first_lines,
    numbers_from_rows,
    read_floats,
    read_head,
    read_rows,
)
from enliven_edge.importing.skeletons import (
    CONFIDENCE_OF_STATE,
    KINECT2_NAMES,
    KINECT2_ORDER,
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    SkeletonReader,
    joints_from_pixels,
    make_tracked_body,
    mask_missing,
)

_SCAN_HEADER = ["Joints", "X", "Y", "Z"]
_SCAN_TILT = "Degree"
_GAIT_NAMES = {joint.name.replace("_", "-").title(): joint for joint in Joint} | {
    "Hip-Centro": Joint.HIP_CENTER,
    "Shoulder-Centro": Joint.SHOULDER_CENTER,
}
"""The joint of each name in KinectGait. Its files mix languages (``Hip-centro``)."""
_LABANOTATION_COLUMNS = 101
"""Numbers per row: the time, and x, y, z and the tracking state of 25 joints."""
_TICK_NS = 100
"""Nanoseconds of a tick, the Kinect SDK 2's unit of time."""
MSR_ORDER = (
    Joint.SHOULDER_LEFT,
    Joint.SHOULDER_RIGHT,
    Joint.SHOULDER_CENTER,
    Joint.SPINE,
    Joint.HIP_LEFT,
    Joint.HIP_RIGHT,
    Joint.HIP_CENTER,
    Joint.ELBOW_LEFT,
    Joint.ELBOW_RIGHT,
    Joint.WRIST_LEFT,
    Joint.WRIST_RIGHT,
    Joint.HAND_LEFT,
    Joint.HAND_RIGHT,
    Joint.KNEE_LEFT,
    Joint.KNEE_RIGHT,
    Joint.ANKLE_LEFT,
    Joint.ANKLE_RIGHT,
    Joint.FOOT_LEFT,
    Joint.FOOT_RIGHT,
    Joint.HEAD,
)
"""(20,) the joint in each row of a frame. "Right" is the side that the subjects of the data set had to
use."""
MSR_FOCAL = 285.0
"""Focal length in pixels of the depth camera (320x240) in files with pixel coordinates. With this value they
agree with the files in metres.
"""
_MSR_CENTRE = (160.0, 120.0)
"""Column and row of the image's centre in pixels."""
_MSR_METRES_PER_UNIT = 0.004
"""Metres per unit of depth in files with pixel coordinates. With this value they agree with the files in
metres.
"""
_MSR_FPS = 15.0
"""Frames per second of the data set, which its files do not state."""


class BodyScannerReader(SkeletonReader):
    """Reads BodyScanner CSV.

    A file has the header ``Joints,X,Y,Z``, a row ``Degree`` with the sensor's tilt, and 25 joints, +Y up, +Z
    towards the sensor.
    """

    name = "body-scanner"
    description = "BodyScanner-Kinect CSV (the joints of a single frame, with the sensor's tilt)"
    note = "the file contains a single frame; every joint counts as tracked"
    sensor = "kinect2"

    def matches(self, path: Path) -> bool:
        """Returns True if the first two rows are the header and the row ``Degree``."""
        rows = [line.split(",") for line in first_lines(read_head(path), 2)]
        return len(rows) == 2 and rows[0] == _SCAN_HEADER and rows[1][0] == _SCAN_TILT

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns a single moment with one body, rotated by the sensor's tilt so that +Y is up.

        Raises:
            InputError: if a joint is missing, or a value is not a number.
        """
        rows = read_rows(path)[1:]
        values = numbers_from_rows([row[1:] for row in rows], path, 3, 2)
        position_by_name = {row[0].strip(): xyz for row, xyz in zip(rows, values, strict=False)}
        missing_names = [name for name in (_SCAN_TILT, *KINECT2_NAMES) if name not in position_by_name]
        if missing_names:
            raise InputError(f"the row {missing_names[0]} is missing", where=str(path))
        degrees = float(position_by_name[_SCAN_TILT][0])
        if not math.isfinite(degrees):
            raise InputError(f"the row {_SCAN_TILT} has no finite number of degrees", where=str(path))
        level = level_from_tilted(math.radians(degrees))
        # In the file, as in the world, +Z points to the sensor.
        joints = (
            np.array([position_by_name[name] for name in KINECT2_NAMES]) @ (WORLD_FROM_KINECT_SPACE @ level).T
        )
        return [SkeletonMoment(0, [make_tracked_body(joints)])]


def level_from_tilted(tilt: float) -> Float:
    """Returns a (3, 3) rotation from the space of a tilted sensor to the space of a level sensor.

    The sensor is tilted downwards by ``tilt`` radians.
    """
    c, s = math.cos(tilt), math.sin(tilt)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


class GaitReader(SkeletonReader):
    """Reads KinectGait text: lines ``Joint-Name;x;y;z`` in metres.

    A frame starts at ``Head`` and has 20 lines.
    """

    name = "kinect-gait"
    description = "KinectGait text (Joint-Name;x;y;z lines, 20 a frame)"
    note = (
        "the file contains no times, so 30 frames a second are assumed; it contains no tracking states, "
        "so every joint counts as tracked"
    )

    def matches(self, path: Path) -> bool:
        """Returns True if each of the first 20 lines has a known joint name and three values."""
        rows = [line.split(";") for line in first_lines(read_head(path), 20)]
        return bool(rows) and all(len(row) == 4 and row[0].strip().title() in _GAIT_NAMES for row in rows)

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns one body for each frame, by default at 30 frames per second. Missing joints are NaN.

        Raises:
            InputError: for an unknown joint, or a value that is not a number.
        """
        rows = read_rows(path, ";")
        joints = [_gait_joint(row[0], path, line) for line, row in enumerate(rows, 1)]
        values = numbers_from_rows([row[1:] for row in rows], path, 3)
        starts = [line for line, joint in enumerate(joints) if joint == Joint.HEAD] + [len(values)]
        moments = []
        for start, end, time_ns in zip(starts, starts[1:], options.times_ns(30.0), strict=False):
            xyz = np.full((len(Joint), 3), np.nan)
            xyz[joints[start:end]] = values[start:end]
            if np.isfinite(xyz[:, 0]).any():
                moments.append(SkeletonMoment(time_ns, [make_tracked_body(xyz)]))
        return moments


def _gait_joint(name: str, path: Path, line: int) -> Joint:
    joint = _GAIT_NAMES.get(name.strip().title())
    if joint is None:
        problem, remedy = (
            f"line {line} names the unknown joint {name!r}",
            f"Known joints: {', '.join(_GAIT_NAMES)}.",
        )
        raise InputError(problem, where=str(path), remedy=remedy)
    return joint


class LabanotationReader(SkeletonReader):
    """Reads LabanotationSuite CSV without a header.

    A row has 101 values: the time in ticks of 100 ns, then x, y, z and the tracking state of 25 joints.
    """

    name = "labanotation"
    description = "Kinect v2 skeleton CSV of the LabanotationSuite (time, 25 joints with tracking states)"
    note = ""
    sensor = "kinect2"

    def matches(self, path: Path) -> bool:
        """Returns True if the first row has exactly 101 numbers."""
        cells = (first_lines(read_head(path), 1) or [""])[0].rstrip(",").split(",")
        return len(cells) == _LABANOTATION_COLUMNS and are_numbers(cells)

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns one body for each row, at the time in the row. The tracking state becomes the confidence.

        Raises:
            InputError: for a row of another length, an unknown tracking state, or a missing time.
        """
        values = numbers_from_rows(read_rows(path), path, _LABANOTATION_COLUMNS)
        joints = values[:, 1:].reshape(-1, 25, 4)[:, KINECT2_ORDER]
        states = joints[..., 3]
        if not np.isin(states, (0.0, 1.0, 2.0)).all() or not np.isfinite(values[:, 0]).all():
            raise InputError("a tracking state is not 0, 1 or 2, or a time is missing", where=str(path))
        times = [int(ticks) * _TICK_NS for ticks in values[:, 0]]
        return _moments_from_joints(times, joints[..., :3], CONFIDENCE_OF_STATE[states.astype(int)])


class MsrAction3dReader(SkeletonReader):
    """Reads MSR Action3D text: 20 rows per frame of x, y, z and confidence.

    Units are metres, or pixels with depth in units of 4 mm.
    """

    name = "msr-action3d"
    description = "MSR Action3D skeleton text (aXX_sXX_eXX_skeleton.txt or _skeleton3D.txt)"
    note = "the file contains no times, so 15 frames a second are assumed"

    def matches(self, path: Path) -> bool:
        """Returns True if each of the first 20 rows has four numbers."""
        rows = [line.split() for line in first_lines(read_head(path), 20)]
        return len(rows) == 20 and all(len(row) == 4 and are_numbers(row) for row in rows)

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns one body for each frame, with joints in metres.

        A median depth of 20 or more cannot be metres, so the file is then read as pixels.

        Raises:
            InputError: if the numbers do not fill complete frames.
        """
        values = read_floats(path)
        if not values.size or values.size % 80:
            problem = f"the file contains {values.size} numbers, which is not a multiple of 80 (one frame)"
            raise InputError(problem, where=str(path), remedy="Copy the file again. It may be cut off.")
        rows = values.reshape(-1, 20, 4)[:, np.argsort(MSR_ORDER)]
        joints = rows[..., :3]
        if float(np.median(joints[..., 2])) >= 20.0:
            joints = joints_from_pixels(
                joints[..., :2], joints[..., 2] * _MSR_METRES_PER_UNIT, MSR_FOCAL, _MSR_CENTRE
            )
        times = [time_ns for time_ns, _ in zip(options.times_ns(_MSR_FPS), rows, strict=False)]
        return _moments_from_joints(times, joints, rows[..., 3])


def _moments_from_joints(times: Sequence[int], joints: Float, confidence: Float) -> list[SkeletonMoment]:
    """Returns the moments of one person from (F,) nanoseconds, (F, 20, 3) joints in metres and (F, 20)
    confidences.
    """
    return [
        SkeletonMoment(time_ns, [Body(0, *mask_missing(xyz, confidences))])
        for time_ns, xyz, confidences in zip(times, joints, confidence, strict=True)
    ]
