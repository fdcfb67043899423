"""Estimates bodies from a colour camera: detects landmarks, lifts them to 3D, and fuses them with depth."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, UInt8
from enliven.camera import Intrinsics, world_from_level_camera
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.person import Body, Joint
from enliven.settings import group, setting
from enliven_edge.landmarks.lifting import Lifter, LiftSettings
from enliven_edge.landmarks.source import LandmarkSource, MediaPipeSettings, MediaPipeSource


@dataclass(frozen=True)
class ColourSettings:
    """Landmarks from the colour image of a depth sensor, fused with the bodies from depth."""

    use: bool = setting(
        False,
        "Also finds people in the colour image, if the sensor has one. This takes additional time per frame.",
    )
    mediapipe: MediaPipeSettings = group(MediaPipeSettings, "Detector of the landmarks.")
    lift: LiftSettings = group(LiftSettings, "Conversion of landmarks to bodies.")


_TRUNK = [Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD]
_SAME_PERSON_M = 0.5
"""Maximum distance in metres between two trunks of the same person."""
_AGREEMENT_M = 0.12
"""Maximum distance of two positions of a joint that agree, in metres. Positions farther apart contradict each
other."""


def fuse_people(depth: list[Body], colour: list[Body]) -> list[Body]:
    """Returns the depth bodies, each fused with the colour body of the same person.

    The nearest pairs come first.

    People that are visible only in the colour image are dropped, because the depth tracker decides which
    people exist.
    """
    pairs = sorted(
        (distance, i, k)
        for i, a in enumerate(depth)
        for k, b in enumerate(colour)
        if (distance := _trunk_distance(a, b)) < _SAME_PERSON_M
    )
    fused_bodies, used_colour = list(depth), set[int]()
    matched_colour = set[int]()
    for _, i, k in pairs:
        if i not in matched_colour and k not in used_colour:
            fused_bodies[i] = fuse_bodies(depth[i], colour[k])
            matched_colour.add(i)
            used_colour.add(k)
    return fused_bodies


def fuse_bodies(depth: Body, colour: Body) -> Body:
    """Fuses two bodies of the same person.

    If both bodies agree on a joint, the result is their mean, weighted by confidence, with a higher
    confidence than either. If they contradict each other, the more confident joint is used, with a lower
    confidence. A joint that only one body has is copied. Identity, orientations and all other fields come
    from the depth body.
    """
    depth_confidence, colour_confidence = np.clip(depth.confidence, 0, 1), np.clip(colour.confidence, 0, 1)
    distance = np.linalg.norm(depth.joints - colour.joints, axis=1)
    agrees = np.exp(-0.5 * (distance / _AGREEMENT_M) ** 2)
    more_confident = colour_confidence > depth_confidence
    weighted_mean = colour_confidence / np.maximum(depth_confidence + colour_confidence, 1e-9)
    chosen_weight = np.where(more_confident, 1.0, 0.0)
    colour_weight = np.where(
        colour_confidence > 0, agrees * weighted_mean + (1 - agrees) * chosen_weight, 0.0
    )
    joints = depth.joints + colour_weight[:, None] * (colour.joints - depth.joints)
    has_both = 1.0 - (1.0 - depth_confidence) * (1.0 - colour_confidence)
    contradicts = np.maximum(depth_confidence, colour_confidence) - 0.5 * np.minimum(
        depth_confidence, colour_confidence
    )
    confidence = agrees * has_both + (1 - agrees) * contradicts
    return dataclasses.replace(depth, joints=joints, confidence=np.clip(confidence, 0.0, 1.0))


def _trunk_distance(a: Body, b: Body) -> float:
    """Returns the distance in metres between two trunks, averaged over their shared joints."""
    is_shared = np.array([a.confidence[j] > 0 and b.confidence[j] > 0 for j in _TRUNK])
    if not is_shared.any():
        return float("inf")
    gap: Float = np.linalg.norm(a.joints[_TRUNK] - b.joints[_TRUNK], axis=1)
    return float(gap[is_shared].mean())


_MAX_STEP_M = 0.6
"""Maximum metres that a person moves between two frames."""
_FORGET_AFTER_NS = 2_000_000_000
"""Nanoseconds after which a lost person gets a new id."""


class ColourPoseEstimator:
    """Estimates bodies from one colour camera with a landmark detector.

    Args:
        source: detects the landmarks. The caller closes it.
    """

    def __init__(self, source: LandmarkSource, settings: LiftSettings | None = None) -> None:
        self._source, self._lifter = source, Lifter(settings)
        self._known: dict[int, tuple[Float, int]] = {}
        self._next = 1

    def improve(self, bodies: list[Body], frame: DepthFrame, world_from_camera: Float) -> list[Body]:
        """Returns a frame's depth bodies, fused with the bodies in its colour image if the frame has
        colour.
        """
        if frame.colour is None or not bodies:
            return bodies
        detections = self._source.find(frame.colour, frame.time_ns)
        lifted_bodies = [
            self._lifter.lift(landmarks, frame, world_from_camera, -1) for landmarks in detections
        ]
        return fuse_people(bodies, lifted_bodies)

    def bodies(self, colour: UInt8, camera: Intrinsics, world_from_camera: Float, time_ns: int) -> list[Body]:
        """Returns the 2.5-D bodies of a camera without depth. Their ids persist from frame to frame."""
        detections = self._source.find(colour, time_ns)
        guesses = [
            self._lifter.lift_without_depth(landmarks, camera, world_from_camera, -1)
            for landmarks in detections
        ]
        return self._assign_ids(guesses, time_ns)

    def _assign_ids(self, bodies: list[Body], time_ns: int) -> list[Body]:
        """Returns the bodies with the ids of the nearest bodies in the previous frame. Bodies without a near
        one get new ids.
        """
        self._known = {
            i: last_seen
            for i, last_seen in self._known.items()
            if 0 <= time_ns - last_seen[1] < _FORGET_AFTER_NS
        }
        positions = [body.joints[Joint.SHOULDER_CENTER] for body in bodies]
        pairs = sorted(
            (float(np.linalg.norm(place - last_seen[0])), k, i)
            for k, place in enumerate(positions)
            for i, last_seen in self._known.items()
        )
        numbers: dict[int, int] = {}
        for distance, k, i in pairs:
            if distance < _MAX_STEP_M and k not in numbers and i not in numbers.values():
                numbers[k] = i
        for k, place in enumerate(positions):
            if k not in numbers:
                numbers[k], self._next = self._next, self._next + 1
            self._known[numbers[k]] = (place, time_ns)
        return [dataclasses.replace(body, id=numbers[k]) for k, body in enumerate(bodies)]


class MonocularPoseEstimator:
    """Estimates bodies from a level camera with an approximately known field of view and without depth.

    Args:
        view: degrees, horizontal field of view of the camera.
        height: metres, height of the camera above the floor.
        tilt: degrees that it looks down.
        body_height: metres, height of the performers. A smaller person appears to be farther away.
        python, model: see :class:`~enliven_edge.landmarks.source.MediaPipeSettings`.
        source: detects the landmarks, instead of MediaPipe. It is closed with this object.

    Raises:
        InputError: for an impossible field of view, or a missing model file.
        ResourceError: if MediaPipe cannot be started.
    """

    def __init__(
        self,
        view: float = 65.0,
        height: float = 1.2,
        tilt: float = 0.0,
        body_height: float = 1.72,
        python: str = "",
        model: str = "",
        source: LandmarkSource | None = None,
    ) -> None:
        check_view(view)
        self._view, self._mount = math.radians(view), world_from_level_camera(height, math.radians(tilt))
        self._source = source or MediaPipeSource(MediaPipeSettings(python=python, model=model))
        self._eye = ColourPoseEstimator(self._source, LiftSettings(body_height=body_height))

    def bodies(self, colour: UInt8, time_ns: int) -> list[Body]:
        """Returns the bodies in an (h, w, 3) uint8 sRGB image."""
        camera = pinhole_camera(colour.shape[1], colour.shape[0], self._view)
        return self._eye.bodies(colour, camera, self._mount, time_ns)

    def close(self) -> None:
        """Releases the source. A second call does nothing."""
        self._source.close()


def check_view(view: float) -> None:
    """Checks a horizontal field of view in degrees.

    Raises:
        InputError: if it is impossible for a lens.
    """
    if not 10.0 <= view <= 170.0:
        raise InputError(
            f"the field of view is {view} degrees", where="camera", remedy="Set view to 10 to 170 degrees."
        )


def pinhole_camera(width: int, height: int, view: float) -> Intrinsics:
    """Returns a pinhole camera with a horizontal field of view of ``view`` radians."""
    focal = 0.5 * width / math.tan(0.5 * view)
    return Intrinsics(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))
