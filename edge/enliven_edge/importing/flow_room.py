"""Reads Kinect v2 skeletons in depth pixels, as The Flow Room writes them (JSON)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.files import DECODE_ERRORS, read_file
from enliven.person import PARENTS, Body, Joint
from enliven_edge.importing.base import ImportOptions, read_head
from enliven_edge.importing.skeletons import (
    INFERRED,
    KINECT2_ORDER,
    TRACKED,
    SkeletonMoment,
    SkeletonReader,
    joints_from_pixels,
)

FOCAL = 365.5
"""Focal length in pixels of a Kinect v2's depth camera (512x424). It is the usual one, because the files
contain none."""
CENTRE = (256.0, 212.0)
"""Column and row of the image's centre in pixels."""
STATURE = 1.70
"""Height of an average person from the ankles to the crown, in metres. It determines the distance to the
sensor."""
METRES_PER_Z = 0.0036
"""Metres per unit of z, which the files do not state. With this value the lengths of bones change least while
they turn towards the sensor, for all people in the known recordings. In millimetres people would be flat."""
_MAX_NUMBER = 1e10
"""Largest pixel or z of a joint. It is larger than any 32-bit integer, in case one marks a missing point."""
_INVALID = -500
"""Maximum z of an unmeasured point. The files use large negative numbers for such points."""
_MAX_DEPTH_STEP_M = 0.4
"""Maximum depth difference in metres between neighbouring joints. A joint with a larger difference was
measured on the background."""
_HEAD_TO_ANKLE = 0.88
"""The head joint's height above the ankles as a fraction of the stature."""


class _Point(msgspec.Struct):
    x: float
    y: float
    z: float


class JointPixels(msgspec.Struct):
    """A person of a frame, with its joints in pixels of the depth image."""

    joints: list[_Point]
    trackingId: str = ""


log = logging.getLogger(__name__)
_decoder = msgspec.json.Decoder(list[list[JointPixels]])


class FlowRoomReader(SkeletonReader):
    """Frames of bodies with 21 joints: x, y in pixels of the depth image, z with unknown unit and origin.

    The origin of z is the same for all people in a file. It is chosen so that the people are 1.70 m tall on
    average. Body shapes are accurate to a few per cent, but distances from the sensor are not measured.
    """

    name = "flow-room"
    description = "Kinect v2 JSON of The Flow Room (21 joints in depth pixels, one or more people)"
    note = (
        "the file states no unit and no origin of z, so people are assumed to be 1.70 m tall; it contains "
        "no times, so 30 frames a second are assumed"
    )

    sensor = "kinect2"

    def matches(self, path: Path) -> bool:
        """Returns True if the file starts with a JSON list of bodies with joints."""
        head = read_head(path, 512).lstrip()
        return head.startswith(b"[") and b'"bodyIndex"' in head and b'"joints"' in head

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns the bodies at each moment, by default at 30 frames per second.

        Joints are metres in the skeleton space of the Kinect. Repaired joints count as inferred.

        Raises:
            InputError: if the file is damaged, or contains no usable body.
        """
        frames = read_frames(path)
        pixels = [[clean_joints(skeleton) for skeleton in frame] for frame in frames]
        distance = estimate_distance([points for frame in pixels for points, _ in frame], path)
        ids: dict[str, int] = {}
        moments = []
        for frame, points, time_ns in zip(frames, pixels, options.times_ns(30.0), strict=False):
            moment = SkeletonMoment(time_ns)
            for skeleton, (uvz, is_measured) in zip(frame, points, strict=True):
                number = ids.setdefault(skeleton.trackingId, len(ids))
                joints = joints_from_pixels(uvz[:, :2], distance + uvz[:, 2] * METRES_PER_Z, FOCAL, CENTRE)
                moment.bodies.append(Body(number, joints, np.where(is_measured, TRACKED, INFERRED)))
            moments.append(moment)
        return moments


def read_frames(path: Path) -> list[list[JointPixels]]:
    """Returns the people of each frame of a file.

    Raises:
        InputError: if the file is damaged, of another kind, or has impossible joints.
    """
    try:
        frames = _decoder.decode(read_file(path))
    except DECODE_ERRORS as error:
        log.debug("%s", path, exc_info=error)
        remedy = "Choose a file that The Flow Room recorded."
        problem = "the JSON is truncated, damaged or of another kind"
        raise InputError(problem, where=str(path), remedy=remedy) from None
    for number, frame in enumerate(frames):
        for skeleton in frame:
            if len(skeleton.joints) != 21:
                raise InputError(
                    f"frame {number} has a body with {len(skeleton.joints)} joints instead of 21",
                    where=str(path),
                )
            if any(max(abs(p.x), abs(p.y), abs(p.z)) > _MAX_NUMBER for p in skeleton.joints):
                raise InputError(f"frame {number} has a joint at an impossible position", where=str(path))
    return frames


def clean_joints(skeleton: JointPixels) -> tuple[Float, Bool]:
    """Returns (20, 3) u, v, z and (20,) whether z was measured.

    An unmeasured z is copied from the parent joint.
    """
    points = np.array([(p.x, p.y, p.z) for p in skeleton.joints], float)[list(KINECT2_ORDER)]
    is_measured = points[:, 2] > _INVALID
    median = float(np.median(points[is_measured, 2])) if is_measured.any() else 0.0
    for joint, parent in enumerate(PARENTS):
        expected = points[parent, 2] if parent >= 0 else median
        if not is_measured[joint] or abs(points[joint, 2] - expected) * METRES_PER_Z > _MAX_DEPTH_STEP_M:
            points[joint, 2], is_measured[joint] = expected, False
    return points, is_measured


def estimate_distance(bodies: Sequence[Float], path: Path) -> float:
    """Returns the distance in metres from the sensor to z = 0.

    It is computed from the upper quartile of the people's heights in pixels.

    Args:
        bodies: (20, 3) u, v, z of each person in each frame.
        path: the file, for the error message.

    Raises:
        InputError: if no person stands upright.
    """
    heights = [
        float(max(uvz[Joint.ANKLE_LEFT, 1], uvz[Joint.ANKLE_RIGHT, 1]) - uvz[Joint.HEAD, 1]) for uvz in bodies
    ]
    height_px = float(np.percentile(heights, 75)) if heights else 0.0
    if height_px < 20.0:
        raise InputError(
            "the recording shows no person who stands upright, so the distance to the sensor is unknown",
            where=str(path),
        )
    centre = float(np.median([uvz[:, 2] for uvz in bodies])) * METRES_PER_Z
    return FOCAL * STATURE * _HEAD_TO_ANKLE / height_px - centre
