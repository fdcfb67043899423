"""Skeletons of the MSR Action3D data set, in pixels or in metres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import Body, Joint
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, head_of, only_one, text_of
from enliven_edge.importing.skeletons import (
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    frames_in_world,
    observed,
)
from enliven_edge.importing.tables import are_numbers, first_lines

ORDER = (
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
"""(20,) the joint in each row of a frame. Right is the side that the subjects were told to use."""
FOCAL = 285.0
"""Focal length of the pixel form's depth camera (320x240), pixels, for which both forms agree."""
CENTRE_U = 160.0
"""Column of the image's centre, pixels."""
CENTRE_V = 120.0
"""Row of the image's centre, pixels."""
_METRES_PER_DEPTH = 0.004
"""Metres of one unit of depth in the pixel form, for which both forms agree."""
_FPS = 15.0
"""Frames a second of the data set, which its files do not state."""


class MsrAction3dReader(Reader):
    """20 rows a frame of x, y, z, confidence; either metres, or pixels and depth in units of 4 mm."""

    name = "msr-action3d"
    description = "MSR Action3D skeleton text (aXX_sXX_eXX_skeleton.txt or _skeleton3D.txt)"
    note = "no times in the files: 15 frames a second"

    def can_read(self, paths: Sequence[Path]) -> bool:
        return any(_matches(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        path = only_one([path for path in paths if _matches(path)] or paths)
        rows = _numbers(path).reshape(-1, 20, 4)
        joints = np.empty((len(rows), 20, 3))
        confidence = np.empty((len(rows), 20))
        joints[:, ORDER] = in_metres(rows[..., :3])
        confidence[:, ORDER] = rows[..., 3]
        moments = [
            SkeletonMoment(time_ns, [Body(0, *observed(xyz, seen))])
            for time_ns, xyz, seen in zip(options.times_ns(_FPS), joints, confidence, strict=False)
        ]
        return frames_in_world(moments, options.device or "kinect1", WORLD_FROM_KINECT_SPACE, str(path))


def in_metres(rows: Float) -> Float:
    """Returns (F, 20, 3) the joints in the Kinect's skeleton space, from either form."""
    if float(np.median(rows[..., 2])) < 20.0:
        return rows
    z = rows[..., 2] * _METRES_PER_DEPTH
    x = (rows[..., 0] - CENTRE_U) / FOCAL * z
    y = (CENTRE_V - rows[..., 1]) / FOCAL * z
    return np.stack([x, y, z], -1)


def _numbers(path: Path) -> Float:
    try:
        values = np.array([float(word) for word in text_of(path).split()])
    except ValueError as error:
        raise InputError(f"it holds something else than numbers ({error})", where=str(path)) from None
    if not values.size or values.size % 80:
        raise InputError(
            f"it holds {values.size} numbers, not 80 for each frame",
            where=str(path),
            mend="Copy it again; it may have been cut off.",
        )
    return values


def _matches(path: Path) -> bool:
    lines = first_lines(head_of(path), 20)
    rows = [line.split() for line in lines]
    return len(rows) == 20 and all(len(row) == 4 and are_numbers(row) for row in rows)
