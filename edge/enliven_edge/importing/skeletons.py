"""Converts the skeletons of foreign recordings to bodies in the world.

The Kinect SDKs' skeleton space has +X to the sensor's left, +Y up and +Z away from the sensor, in metres. It
is right-handed. So a rotation by 180 degrees about the vertical converts it to the world of a level camera
(+X to the sensor's right, +Z towards the sensor). In this world a person who faces the sensor looks along
+Z, with the left hand at +X.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import ANKLE_ABOVE_SOLE, Body, Joint
from enliven_edge.importing.base import DEFAULT_OPTIONS, FileReader, ImportOptions

WORLD_FROM_KINECT_SPACE = np.diag([-1.0, 1.0, -1.0])
"""(3, 3) world_from_sensor of a level sensor for the skeleton space of the Kinect SDKs 1 and 2."""
KINECT2_ORDER = (0, 1, 20, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19)
"""(20,) the index of the Kinect SDK 2 joint (JointType) for each :class:`enliven.person.body.Joint`.

SpineBase, SpineMid and SpineShoulder correspond to the hip centre, the spine and the shoulder centre. The
neck, the hand tips and the thumbs have no counterpart."""
_SPINE_NAMES = ["SpineBase", "SpineMid", "SpineShoulder"]
KINECT2_NAMES = [*_SPINE_NAMES, *(joint.name.title().replace("_", "") for joint in list(Joint)[3:])]
"""(20,) the name of the Kinect SDK 2 joint for each :class:`enliven.person.body.Joint`."""
TRACKED = 1.0
"""Confidence of a joint that the SDK reports as tracked."""
INFERRED = 0.4
"""Confidence of a joint that the SDK inferred from others. It has less weight than a measured joint."""
NOT_TRACKED = 0.0
"""Confidence of a joint that the SDK does not know."""
CONFIDENCE_OF_STATE = np.array([NOT_TRACKED, INFERRED, TRACKED])
"""(3,) the confidence of the SDKs' tracking states 0, 1 and 2."""
MAX_DISTANCE_M = 1000.0
"""A joint that is farther from the sensor than this is damaged data. Depth sensors reach a few metres."""
FOOT_ABOVE_SOLE = 0.02
"""Height in metres of an average adult's foot joint above the sole."""
_FEET = (Joint.FOOT_LEFT, Joint.FOOT_RIGHT)
_ANKLES = (Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT)


@dataclass(frozen=True)
class SkeletonMoment:
    """The bodies at one time, in the sensor's skeleton space."""

    time_ns: int
    bodies: list[Body] = field(default_factory=list)


class SkeletonReader(FileReader):
    """Base class of readers of joints. A subclass provides the moments and the name of the sensor."""

    sensor = "kinect1"
    """The sensor's identity if the user gives none."""

    def moments(self, path: Path, options: ImportOptions) -> list[SkeletonMoment]:
        """Returns the bodies of a file in the Kinect's skeleton space, ordered by time.

        Raises:
            InputError: for a file (and line) that cannot be read.
        """
        raise NotImplementedError

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        """Yields the bodies of :meth:`moments` in the world frame, on the floor.

        Raises:
            InputError: if the file cannot be read, or contains no measured joint.
        """
        path = self.choose_file(paths)
        sensor = options.device or self.sensor
        return frames_in_world(self.moments(path, options), sensor, WORLD_FROM_KINECT_SPACE, str(path))


def joints_from_pixels(pixels: Float, z: Float, focal: float, centre: tuple[float, float]) -> Float:
    """Returns (..., 3) joints in skeleton space, +Y up, from (..., 2) pixels at depths of (...) metres.

    Args:
        focal, centre: pixels, of the depth camera.
    """
    x = (pixels[..., 0] - centre[0]) / focal * z
    return np.stack([x, (centre[1] - pixels[..., 1]) / focal * z, z], -1)


def make_tracked_body(joints: Float) -> Body:
    """Returns the body of (20, 3) joints from a file without tracking states.

    Every joint counts as tracked.
    """
    return Body(0, *mask_missing(joints, np.full(len(joints), TRACKED)))


def frames_in_world(
    moments: Sequence[SkeletonMoment], sensor: str, world_from_sensor: Float, where: str
) -> Iterator[BodyFrame]:
    """Yields the body frames of a take in the world, on the floor, with an estimated stature per person.

    The floor's height is the lower quartile, over the take, of the lower sole's height. At least one foot is
    nearly always on the floor, and a quartile ignores jumps and some wrong feet. The stature is the median
    over the take of the height computed from bone lengths.

    Args:
        moments: ordered by time.
        sensor: its identity.
        world_from_sensor: (3, 3) rotation from the sensor's space. Bodies with orientations are already in
            the world frame.
        where: the file, for error messages.

    Raises:
        InputError: if no joint was seen.
    """
    rotated = [_move_to_world(moment, world_from_sensor) for moment in moments]
    all_bodies = [body for moment in rotated for body in moment.bodies]
    floor, statures = _estimate_floor(all_bodies, where), _estimate_statures(all_bodies)
    for moment in rotated:
        bodies = [
            replace(b, joints=b.joints - [0.0, floor, 0.0], stature=statures.get(b.id)) for b in moment.bodies
        ]
        yield BodyFrame(bodies, moment.time_ns, sensor)


def mask_missing(joints: Float, confidence: Float) -> tuple[Float, Float]:
    """Returns joints (20, 3) and confidence (20,) with missing joints as NaN and confidence 0.

    Joints farther than :data:`MAX_DISTANCE_M` on an axis are missing, too. Their squares could overflow.
    """
    is_observed: Bool = np.asarray((np.abs(joints) <= MAX_DISTANCE_M).all(-1))
    return np.where(is_observed[:, None], joints, np.nan), np.where(
        is_observed, np.clip(confidence, 0.0, 1.0), 0.0
    )


def _move_to_world(moment: SkeletonMoment, world_from_sensor: Float) -> SkeletonMoment:
    """Returns a moment with rotated bodies. Joints at impossible positions are missing."""
    bodies = []
    for body in moment.bodies:
        joints, confidence = mask_missing(body.joints, body.confidence)
        bodies.append(replace(body, joints=joints @ world_from_sensor.T, confidence=confidence))
    return SkeletonMoment(moment.time_ns, bodies)


def _estimate_statures(bodies: Sequence[Body]) -> dict[int, float]:
    """Returns the stature in metres by person.

    It is the median over the frames that contain all the required joints.
    """
    heights: dict[int, list[float]] = {}
    for body in bodies:
        if np.isfinite(body.joints).all():
            heights.setdefault(body.id, []).append(body.height)
    return {person: float(np.median(samples)) for person, samples in heights.items()}


def _estimate_floor(bodies: Sequence[Body], where: str) -> float:
    lowest = [height for height in map(_sole_height, bodies) if np.isfinite(height)]
    if not lowest:
        raise InputError("no joint of any person was seen", where=where, remedy="Choose another recording.")
    return float(np.percentile(lowest, 25.0))


def _sole_height(body: Body) -> float:
    """Returns the height in metres of a body's lower sole, from the visible joints, or else from all
    joints.
    """
    for min_confidence in (0.5, -1.0):
        candidates = [(j, FOOT_ABOVE_SOLE) for j in _FEET] + [(j, ANKLE_ABOVE_SOLE) for j in _ANKLES]
        heights = [
            float(body.joints[j, 1]) - sole_offset
            for j, sole_offset in candidates
            if body.confidence[j] > min_confidence
        ]
        heights = [height for height in heights if np.isfinite(height)]
        if heights:
            return min(heights)
    return float("nan")
