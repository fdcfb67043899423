"""Lifts landmarks of an image to the 20 joints of a body: by measured depth, or by body height alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import Intrinsics, pixel_rays
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.person import ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT, Body, Joint
from enliven.settings import setting
from enliven_edge.landmarks.source import INDEX, NAMES, Landmarks

_MIN_VISIBILITY = 0.5
"""Minimum visibility of a landmark. Landmarks below it are ignored."""
_MAX_DEPTH_DIFFERENCE_M = 0.22
"""Maximum difference between measured depth and a joint's expected depth. With a larger difference the depth
belongs to another object."""
CONFIDENCE_WITHOUT_DEPTH = 0.35
"""Confidence of a joint that is visible only in the colour image."""

_TRUNK = (0.11, 0.11, 0.10, 0.09)
"""Distance in metres from the skin to the joint: hip centre, spine, shoulder centre and head."""
_ARM = (0.05, 0.04, 0.03, 0.025)
"""Distance in metres from the skin to the joint: shoulder, elbow, wrist and hand."""
_LEG = (0.09, 0.055, 0.04, 0.03)
"""Distance in metres from the skin to the joint: hip, knee, ankle and foot."""
SKIN_TO_JOINT_M = np.array([*_TRUNK, *_ARM, *_ARM, *_LEG, *_LEG])
"""(20,) metres from the visible skin to the joint behind it."""


def _joint_weights() -> Float:
    """Returns the weight (20, 33) of each landmark in a joint. Every row sums to 1."""
    weights = np.zeros((len(Joint), len(NAMES)))

    def put(joint: Joint, **parts: float) -> None:
        for name, share in parts.items():
            weights[joint, INDEX[name.replace("_", " ")]] += share

    # The hip centre is slightly above the hips, and the shoulder centre is slightly above the shoulders. The
    # factors are fractions of the trunk's length from the hips to the shoulders.
    hips, shoulders = {"left_hip": 0.5, "right_hip": 0.5}, {"left_shoulder": 0.5, "right_shoulder": 0.5}
    for joint, up in ((Joint.HIP_CENTER, 0.17), (Joint.SPINE, 0.43), (Joint.SHOULDER_CENTER, 1.1)):
        put(joint, **{name: (1 - up) * share for name, share in hips.items()})
        put(joint, **{name: up * share for name, share in shoulders.items()})
    put(Joint.HEAD, left_ear=0.5, right_ear=0.5)
    for side in ("left", "right"):
        for part, name in (
            ("SHOULDER", "shoulder"), ("ELBOW", "elbow"), ("WRIST", "wrist"),
            ("HIP", "hip"), ("KNEE", "knee"), ("ANKLE", "ankle"), ("FOOT", "foot_index"),
        ):  # fmt: skip
            put(Joint[f"{part}_{side.upper()}"], **{f"{side}_{name}": 1.0})
        hand = Joint[f"HAND_{side.upper()}"]
        put(hand, **{f"{side}_wrist": 0.2, f"{side}_index": 0.4, f"{side}_pinky": 0.4})
    return weights


WEIGHTS = _joint_weights()
_NEEDED_LANDMARKS = np.abs(WEIGHTS) > 0.15
"""(20, 33) True for the landmarks that a joint needs."""


def joints_from_landmarks(landmarks: Float) -> Float:
    """Returns the (20, D) joints of (33, D) landmarks, in pixels or metres."""
    return np.asarray(WEIGHTS @ landmarks)


def joint_visibility(visibility: Float) -> Float:
    """Returns the probability (20,) that each joint is visible. It is that of the joint's least visible
    landmark.
    """
    return np.asarray(np.where(_NEEDED_LANDMARKS, visibility, 1.0).min(1))


_PATCH_RADIUS_M = 0.03
"""Half side in metres of the square around a landmark in which depth is read."""
_MIN_MEDIAN_SAMPLES = 3
"""Minimum number of measured values for a median. It is enough to ignore a single wrong value."""
_HEIGHT_BEYOND_BONES_M = HEAD_ABOVE_JOINT + ANKLE_ABOVE_SOLE
"""Metres of a person's height that bones do not cover: above the head joint and below the ankles."""


@dataclass(frozen=True)
class LiftSettings:
    """Settings for lifting landmarks to bodies."""

    REMOVED_SETTINGS: ClassVar = (
        "visible",
        "depth_margin",
        "without_depth",
    )
    body_height: float = setting(
        1.72, "Assumed height of a person without depth data.", unit="m", low=0.5, high=2.5
    )


class Lifter:
    """Lifts the landmarks of one camera. The colour image must show the same view as the depth image.

    First, the person's position is chosen so that the detector's 3D posture projects onto its landmarks. The
    scale remains unknown, and the distance is proportional to it. Measured depth gives the scale.
    """

    def __init__(self, settings: LiftSettings | None = None) -> None:
        self.settings = settings or LiftSettings()
        self._camera: Intrinsics | None = None
        self._rays: Float = np.empty((0, 0, 2))

    def lift(self, landmarks: Landmarks, frame: DepthFrame, world_from_camera: Float, person: int) -> Body:
        """Returns the body of landmarks that were found in ``frame.colour``.

        A joint is at its measured position if depth confirms it. If the joint is occluded, or depth is
        missing, its position comes from the detector's 3D posture, with less confidence. A joint outside the
        image has confidence 0.

        Raises:
            InputError: for a frame without a colour image.
        """
        if frame.colour is None:
            raise InputError("the frame has no colour image", where=f"frame of {frame.sensor}")
        camera = frame.intrinsics
        pixels = joints_from_landmarks(_to_depth(landmarks.points, frame.colour.shape, camera))
        visibility = joint_visibility(landmarks.visibility)
        posture = self._place_joints(
            landmarks, _to_depth(landmarks.points, frame.colour.shape, camera), camera
        )
        ray, is_inside = self._pixel_ray_coordinates(pixels, camera)
        first = self._measure_depth(frame, pixels, posture[:, 2], is_inside, np.inf)
        usable = np.isfinite(first) & (visibility >= _MIN_VISIBILITY)
        if usable.sum() >= _MIN_MEDIAN_SAMPLES:
            posture = posture * float(np.median((first + SKIN_TO_JOINT_M)[usable] / posture[usable, 2]))
        depth = (
            self._measure_depth(frame, pixels, posture[:, 2], is_inside, _MAX_DEPTH_DIFFERENCE_M)
            + SKIN_TO_JOINT_M
        )
        is_measured = np.isfinite(depth) & is_inside
        local = np.where(
            is_measured[:, None], np.concatenate([ray, np.ones((20, 1))], 1) * depth[:, None], posture
        )
        depth_deviation = (
            np.abs(np.where(is_measured, depth, posture[:, 2]) - posture[:, 2]) / _MAX_DEPTH_DIFFERENCE_M
        )
        agreement = 1.0 - 0.5 * np.minimum(depth_deviation, 1.0)
        confidence = np.where(is_measured, agreement, CONFIDENCE_WITHOUT_DEPTH) * visibility
        confidence[~is_inside | (visibility < _MIN_VISIBILITY)] = 0.0
        return Body(person, _to_world(local, world_from_camera), confidence)

    def lift_without_depth(
        self, landmarks: Landmarks, camera: Intrinsics, world_from_camera: Float, person: int
    ) -> Body:
        """Returns the 2.5-D body of a camera without depth.

        The distance follows from the configured height of a person.
        """
        posture = self._place_joints(landmarks, landmarks.points, camera)
        bones = Body(person, posture, np.ones(20)).height - _HEIGHT_BEYOND_BONES_M
        posture = posture * ((self.settings.body_height - _HEIGHT_BEYOND_BONES_M) / max(bones, 0.1))
        _, is_inside = self._pixel_ray_coordinates(joints_from_landmarks(landmarks.points), camera)
        visibility = joint_visibility(landmarks.visibility)
        confidence = np.where(
            is_inside & (visibility >= _MIN_VISIBILITY), visibility * CONFIDENCE_WITHOUT_DEPTH, 0.0
        )
        return Body(person, _to_world(posture, world_from_camera), confidence)

    def _place_joints(self, landmarks: Landmarks, points: Float, camera: Intrinsics) -> Float:
        """Returns (20, 3) joints in the camera frame that project onto the landmarks.

        Their scale is that of the landmarks' 3D posture.
        """
        ray, is_inside = self._pixel_ray_coordinates(points, camera)
        weight = landmarks.visibility * np.where(is_inside, 1.0, 0.2)
        x, y, z = landmarks.offsets.T
        # A landmark at the offset (x, y, z) from the body's position t = (tx, ty, tz) projects to the ray (u,
        # v). So x + tx = u (z + tz) and y + ty = v (z + tz). These equations are linear in t.
        rows = np.zeros((2 * len(points), 3))
        rows[: len(points), 0] = rows[len(points) :, 1] = 1.0
        rows[: len(points), 2], rows[len(points) :, 2] = -ray[:, 0], -ray[:, 1]
        right = np.concatenate([ray[:, 0] * z - x, ray[:, 1] * z - y])
        weights = np.concatenate([weight, weight]) + 1e-3
        place = np.linalg.lstsq(rows * weights[:, None], right * weights, rcond=None)[0]
        place[2] = max(place[2], 0.3 - float(z.min()))
        return joints_from_landmarks(landmarks.offsets) + place

    def _pixel_ray_coordinates(self, pixels: Float, camera: Intrinsics) -> tuple[Float, Bool]:
        """Returns (N, 2) x/z and y/z of pixels, and (N,) whether each pixel is inside the image."""
        if camera != self._camera:
            self._camera, self._rays = camera, pixel_rays(camera)
        size = np.array([camera.width, camera.height])
        is_inside = np.asarray(((pixels > -0.5) & (pixels < size - 0.5)).all(1))
        pinhole = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        if not any(camera.distortion):
            return pinhole, is_inside
        u, v = np.rint(np.clip(pixels, 0, size - 1)).astype(int).T
        return np.where(is_inside[:, None], self._rays[v, u], pinhole), is_inside

    def _measure_depth(
        self, frame: DepthFrame, pixels: Float, expected: Float, inside: Bool, margin: float
    ) -> Float:
        """Returns the surface depth (20,) in metres around each joint's pixel.

        NaN means that no depth is within ``margin`` of the expected one.
        """
        depth, camera = frame.depth, frame.intrinsics
        joint_depths = np.full(len(pixels), np.nan)
        for joint in np.flatnonzero(inside):
            u, v = np.rint(pixels[joint]).astype(int)
            reach = int(np.clip(round(_PATCH_RADIUS_M * camera.fx / max(expected[joint], 0.3)), 1, 12))
            patch = depth[max(v - reach, 0) : v + reach + 1, max(u - reach, 0) : u + reach + 1]
            metres = patch[(patch > 0) & (patch < 65535)] * 1e-3
            metres = metres[np.abs(metres + SKIN_TO_JOINT_M[joint] - expected[joint]) <= margin]
            if len(metres) >= _MIN_MEDIAN_SAMPLES:
                joint_depths[joint] = np.median(metres)
        return joint_depths


def _to_depth(points: Float, shape: tuple[int, ...], camera: Intrinsics) -> Float:
    """Returns (N, 2) pixels of the depth image from pixels of the colour image of the same view."""
    scale = np.array([camera.width / shape[1], camera.height / shape[0]])
    return np.asarray((points + 0.5) * scale - 0.5)


def _to_world(local: Float, world_from_camera: Float) -> Float:
    return np.asarray(local @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])
