"""Tracks a moving object: aligns each image with the known surface of the object, separately from the
room.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Bool, Float
from enliven.frames import DepthFrame
from enliven.scanning.depth_view import DepthView, restrict_view
from enliven.scanning.frame_to_model_tracking import Alignment, CameraTracker
from enliven.scanning.loop_closure.history import MAX_HISTORY_MB, FrameHistory
from enliven.scanning.objects.nearness import surface_distances
from enliven.scanning.objects.object_model import ObjectModel
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.rigid import invert_pose
from enliven.scanning.settings import MIN_AGREEING_FRACTION, MIN_OVERLAP_FRACTION, ScanSettings

_MAX_FOLLOWED_SIGMA_M = 0.25
"""Maximum standard deviation of the camera position relative to the object. Above it, the rotation counts as
unknown."""

_FINE_VOLUME = 1
"""Index of the volume, with 16 mm voxels, that decides which points lie on a surface."""
_COARSE_VOLUME = 2
"""Index of the volume, with 64 mm voxels, that decides which points may lie on a surface."""
_TRACKING_RANGE_M = 0.06
"""Points within this distance of the surface, metres, are used to track the object. It allows for the motion
between two images."""
_LOST_TRACKING_RANGE_M = 0.2
"""The same distance, metres, after the object was lost. The truncation band of the coarsest voxels is this
wide."""
_LIFT_HEIGHTS_M = 0.06, 0.12, 0.18
"""Heights, metres, above its last position at which the object is searched. The start of a motion is detected
late."""
_SEARCH_ROTATIONS = 0.1, -0.1, 0.2, -0.2
"""Rotations about the up direction, radians (6 and 11 degrees), at which the object is searched."""
_OBJECT_DISTANCE_M = 0.02
"""Points within this distance of the surface, metres, belong to the object. It is the pixel noise plus the
pose error."""
_ROOM_DISTANCE_M = 0.015
"""Points within this distance of the room's surface, metres, belong to the room."""
_EXTENT_MARGIN_M = 0.03
"""A point up to this distance, metres, outside the known bounding box may still belong to the object, because
new sides come into view."""
_MAX_EXTENT_GROWTH = 2.5
"""Maximum growth of the known bounding box relative to its first size. The first view, from one side, shows
half of an object."""
_MIN_MODEL_IMAGES = 10
"""For an object that never stood still, minimum number of images before its pose uncertainty is estimated.
With fewer images, noise in the model looks like slopes that rotate."""
_MIN_OBJECT_PIXELS = 150
"""Minimum number of half-size pixels for tracking an object: a hand's width at two metres."""
_MAX_ROTATION = 0.5
"""Maximum rotation between two images, radians. A larger rotation is a wrong pose that looks similar."""
_MAX_DISPLACEMENT_M = 0.15
"""Maximum displacement of the object's centre between two images, metres. A larger displacement is a wrong
pose."""


@dataclass(frozen=True)
class ObjectTrackingResult:
    """The tracking result of an object in an image.

    Attributes:
        sure: True if the object was found. If False, nothing is fused.
        object_from_camera: (4, 4) the camera's pose in the object's frame; the last known pose if the object
            was not found.
        object_points: (h, w) half-size pixels that may belong to the object; they are excluded when tracking
            the room.
        alignment: the fitted pose and its quality. None if too little of the object is visible.
    """

    sure: bool
    object_from_camera: Float
    object_points: Bool
    alignment: Alignment | None


class ObjectFollower:
    """A tracker of one object by its own surface, through the images in which it moves.

    The object's pixels are those near its predicted surface. The prediction assumes constant velocity. These
    pixels are aligned with the object's surface, as a camera image is aligned with a room (Ruenz and Agapito,
    "Co-Fusion", ICRA 2017, section V). New surface next to the object, above the ground and not part of the
    room, is fused if the pose is reliable.

    Args:
        model: the known surface of the object, which grows.
        rest: the scan of the room at the last rest, and the object's pose in it.
        object_from_camera: (4, 4) the camera's pose in the object's frame before it moved.
    """

    def __init__(
        self, model: ObjectModel, rest: ObjectRest, object_from_camera: Float, settings: ScanSettings
    ) -> None:
        self.settings, self._model, self._rest = settings, model, rest
        self._pose = self._likely = object_from_camera
        self._going = np.eye(4)
        self._most = _MAX_EXTENT_GROWTH * model.size
        self.history = FrameHistory(MAX_HISTORY_MB)
        self.poses: list[Float] = []
        self.missed = 0
        self._fresh = 0 if rest.numbers else _MIN_MODEL_IMAGES

    @property
    def pose(self) -> Float:
        """(4, 4) the newest pose of the camera in the object's frame."""
        return self._pose

    def find(self, view: DepthView, room_from_camera: Float) -> ObjectTrackingResult:
        """Returns the object's pose in an image, before the room is tracked in it.

        Args:
            room_from_camera: (4, 4) approximate camera pose in the room.
        """
        alignment = self._choose_best_pose(view, self._likely, room_from_camera)
        if alignment is None or not self._is_reliable(alignment):
            starts = [self._likely, self._pose, *self._lift_poses(room_from_camera)]
            retries = (
                self._choose_best_pose(view, start, room_from_camera, _COARSE_VOLUME) for start in starts
            )
            candidates = [candidate for candidate in (alignment, *retries) if candidate is not None]
            alignment = max(
                candidates, key=lambda one: (self._is_reliable(one), _fit_score(one)), default=None
            )
        sure = alignment is not None and self._is_reliable(alignment)
        pose = alignment.world_from_camera if sure and alignment is not None else self._pose
        distance = surface_distances(self._model.volumes[_COARSE_VOLUME], view, pose)
        object_pixels = np.abs(distance) < _TRACKING_RANGE_M
        return ObjectTrackingResult(
            sure, pose, object_pixels & self._is_above_ground(view, room_from_camera), alignment
        )

    def _lift_poses(self, room_from_camera: Float) -> list[Float]:
        """Returns candidate camera poses (4, 4) in the object's frame, for an object that was lifted or
        turned since the last image.
        """
        ground = self._rest.ground
        up = np.array([0.0, 1.0, 0.0]) if ground is None else ground.normal
        up = self._pose[:3, :3] @ room_from_camera[:3, :3].T @ up
        middle, poses = self._model.middle, list[Float]()
        for height in _LIFT_HEIGHTS_M:
            # The pose belongs to the camera in the object's frame. If the object rises, the camera moves down
            # in this frame.
            pose = self._pose.copy()
            pose[:3, 3] -= height * up
            poses.append(pose)
        for angle in _SEARCH_ROTATIONS:
            rotation_matrix, pose = (
                rotation.to_matrix(rotation.from_rotation_vector(angle * up)),
                self._pose.copy(),
            )
            pose[:3, :3] = rotation_matrix @ pose[:3, :3]
            pose[:3, 3] = middle + rotation_matrix @ (pose[:3, 3] - middle)
            poses.append(pose)
        return poses

    def update(
        self, frame: DepthFrame, view: DepthView, result: ObjectTrackingResult, room_from_camera: Float
    ) -> None:
        """Updates the motion from a tracking result, and fuses the image if the result is reliable.

        Args:
            room_from_camera: (4, 4) the tracked camera pose in the room.
        """
        if not result.sure:
            self.missed += 1
            self._likely = self._likely @ self._going
            return
        if not self.missed:
            self._going = invert_pose(self._pose) @ result.object_from_camera
        self.missed, self._pose = 0, result.object_from_camera
        self._likely = self._pose @ self._going
        object_pixels, is_known = self.object_points(view, room_from_camera)
        self._model.fuse(restrict_view(view, object_pixels), self._pose)
        if self._model.size < self._most:
            points = view.points[is_known] @ self._pose[:3, :3].T + self._pose[:3, 3]
            self._model.grow(points)
        self.history.add(len(self.poses), frame)
        self.poses.append(self._pose)

    def object_points(self, view: DepthView, room_from_camera: Float) -> tuple[Bool, Bool]:
        """Returns two (h, w) masks: the points that are fused, and the subset on already known surface."""
        distance = surface_distances(self._model.volumes[_FINE_VOLUME], view, self._pose)
        is_known = np.abs(distance) < _OBJECT_DISTANCE_M
        # Exclude points in front of the known surface. They are in space that was free before, so they belong
        # to a hand.
        is_new = np.isnan(distance) | (distance < -_OBJECT_DISTANCE_M)
        local = view.points @ self._pose[:3, :3].T + self._pose[:3, 3]
        is_candidate = self._model.contains(local, _EXTENT_MARGIN_M) & self._is_above_ground(
            view, room_from_camera
        )
        object_pixels = (
            (is_known | (is_new & ~self._is_on_room_surface(view, room_from_camera)))
            & is_candidate
            & (view.worth > 0)
        )
        return object_pixels, object_pixels & is_known

    def read_views(self) -> Iterator[tuple[DepthView, Float]]:
        """Yields the fused images and their poses (4, 4), object_from_camera. The images are restricted to
        points on the current surface of the object.
        """
        scanner = self._rest.scanner
        for number, frame in self.history.frames():
            view, pose = scanner.prepare_view(frame), self.poses[number]
            distance = surface_distances(self._model.volumes[_FINE_VOLUME], view, pose)
            yield restrict_view(view, np.abs(distance) < _OBJECT_DISTANCE_M), pose

    def _choose_best_pose(
        self, view: DepthView, start: Float, room_from_camera: Float, coarsest: int = 1
    ) -> Alignment | None:
        """Returns the best pose near a start pose, using only points near the surface. Returns None if too
        few points are near the surface."""
        is_near = np.abs(surface_distances(self._model.volumes[_COARSE_VOLUME], view, start)) < (
            _TRACKING_RANGE_M if coarsest < _COARSE_VOLUME else _LOST_TRACKING_RANGE_M
        )
        is_near &= self._is_above_ground(view, room_from_camera)
        if np.count_nonzero(is_near) < _MIN_OBJECT_PIXELS:
            return None
        tracker = CameraTracker(self._model.volumes, self.settings.tracking)
        return tracker.align(restrict_view(view, is_near), start, coarsest=coarsest)

    def _is_reliable(self, alignment: Alignment) -> bool:
        """Returns True if an alignment determines the object's pose reliably."""
        if alignment.overlap < MIN_OVERLAP_FRACTION or alignment.agreeing < MIN_AGREEING_FRACTION:
            return False
        if alignment.deviation > _MAX_FOLLOWED_SIGMA_M and len(self.poses) >= self._fresh:
            return False
        # Compute the motion of the object relative to the camera, about the centre of the object.
        step = invert_pose(alignment.world_from_camera) @ self._pose
        cosine = (np.trace(step[:3, :3]) - 1.0) / 2.0
        middle = np.append(self._model.middle, 1.0)
        displacement = invert_pose(alignment.world_from_camera) @ middle - invert_pose(self._pose) @ middle
        images = 1 + self.missed
        return bool(
            cosine > np.cos(min(_MAX_ROTATION * images, np.pi))
            and np.linalg.norm(displacement) < _MAX_DISPLACEMENT_M * images
        )

    def _is_above_ground(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) True for each point above the ground."""
        ground = self._rest.ground
        if ground is None:
            return view.worth > 0
        rotation_matrix, translation = room_from_camera[:3, :3], room_from_camera[:3, 3]
        height = view.points @ (rotation_matrix.T @ ground.normal) + (
            ground.normal @ translation - ground.offset
        )
        return np.asarray((view.worth > 0) & (height > self.settings.cut_out.clearance))

    def _is_on_room_surface(self, view: DepthView, room_from_camera: Float) -> Bool:
        """Returns (h, w) True for each point on the room's surface. Points at the object's former place in
        the room are excluded.
        """
        distance = surface_distances(self._rest.scanner.volumes[_FINE_VOLUME], view, room_from_camera)
        return np.asarray(
            (np.abs(distance) < _ROOM_DISTANCE_M) & ~self._rest.object_pixels(view, room_from_camera)
        )


def _fit_score(alignment: Alignment) -> float:
    """Returns a score of the fit of an image, to choose among several poses."""
    return alignment.agreeing * alignment.overlap
