"""The scanner (dense SLAM): tracks the camera frame by frame, and fuses its images into a surface.

An image with an uncertain pose is not fused.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import LEVEL_WORLD_FROM_CAMERA, Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.meshes import Mesh
from enliven.rotation import nearest_rotation
from enliven.scanning.depth_view import DepthPreparation, DepthView, restrict_view
from enliven.scanning.frame_to_model_tracking import Alignment, CameraTracker
from enliven.scanning.ground_plane import cut_out, find_focus, find_ground
from enliven.scanning.keyframes import Keyframes
from enliven.scanning.loop_closure.history import MAX_HISTORY_MB, FrameHistory
from enliven.scanning.loop_closure.loop_detection import LoopClosure, correct_trajectory
from enliven.scanning.marching_cubes import extract_surface
from enliven.scanning.settings import (
    MIN_AGREEING_FRACTION,
    MIN_OVERLAP_FRACTION,
    ScanSettings,
    VolumeSettings,
)
from enliven.scanning.threads import compute_ahead
from enliven.scanning.tsdf_volume import TsdfVolume

_MAX_CAMERA_SPEED_M_S = 4.0
"""Maximum speed of the camera. If an alignment implies a higher speed, it is rejected, because the camera
probably sees a similar-looking part of the scene."""

_VOXEL_RATIO = 4.0
"""Ratio of voxel sizes between successive volumes. The truncation bands have the same ratio."""
_VOLUME_COUNT = 3
"""Number of volumes. The default voxel sizes are 4, 16 and 64 mm. The coarsest volume recovers a camera that
is up to 25 cm off."""
_KEYFRAMES_PER_FRAME = 4
"""Number of keyframes that are tried in each frame to relocalize a lost camera. Each takes 30 ms."""
_CLEANING_INTERVAL = 90
"""Number of frames between removals of blocks without a surface: three seconds at 30 Hz."""
_MIN_FRAME_S = 1.0 / 30.0
"""Minimum time between two images, seconds. It is used if a recording's timestamps do not increase."""
_MIN_REFUSION_IMAGES = 120
"""Minimum number of images that are fused again. If twice as many are stored, every second one is left out.
This number is enough to average the noise out, and more images would make the user wait longer."""
_COARSE_FUSION_INTERVAL = 3
"""If there are very many images, only every third is fused into the coarse volumes, because these only guide
the tracking. If there are few images, all are fused, because each may show a surface that no other image
shows."""
_MIN_DISPLACEMENT_VOXELS = 0.25
"""All images are fused again if a loop closure displaces an image by at least this distance (voxels). Fusing
again after 1.3 mm reduces the error of leaves, which are 2 mm thick, by a tenth."""
_SURE_DEVIATION_FACTOR = 0.5
"""Maximum standard deviation of the camera's position after ``align_closely``, relative to the usual limit.
It applies to images that left the position uncertain at first."""
_POSITION_TOLERANCE_M = 0.05
"""Change in camera position, metres, that is never rejected as too fast. It is twice the effect of noise and
hand tremor."""
_MAX_AGREEMENT_LOSS = 0.02
"""A loop closure is accepted if the fraction of agreeing points decreases by at most this value. Some
decrease is normal: if a surface was doubled, each image agreed with its own copy of the surface."""


class ScanState(Enum):
    """The result of processing a frame."""

    EMPTY = "empty"
    """The image shows almost no surface, and was skipped."""
    SCANNING = "scanning"
    """The camera was found, and the image was fused."""
    UNSURE = "unsure"
    """The image does not constrain the camera's pose (a blank wall, for example), and was not fused."""
    LOST = "lost"
    """Tracking failed, so the camera pose is unknown. The image was not fused."""
    FOUND = "found"
    """A lost camera may have been relocalized. Fusion resumes once the next frame agrees."""


@dataclass(frozen=True)
class ScanStep:
    """The result of processing a frame.

    Attributes:
        state: the outcome; see :class:`ScanState`.
        world_from_camera: (4, 4) the camera's pose. If the camera was not found, the last known pose. If the
            pose is unsure, the most likely pose.
        alignment: the fitted pose and its quality. None for the first frame, and for an empty frame.
        has_memory: False if new blocks did not fit into memory. After the first failure, no more images are
            fused.
    """

    state: ScanState
    world_from_camera: Float
    alignment: Alignment | None = None
    has_memory: bool = True


@dataclass(frozen=True)
class ExcludedPixels:
    """Half-size pixels (h, w) that are excluded from camera tracking.

    Attributes:
        moving: pixels that show an independently moving object, or None. They are not fused.
        doubtful: pixels of an object that may begin to move, or None. They are excluded if the other pixels
            determine the camera's pose reliably, and they are fused unless they are ``moving``.
    """

    moving: Bool | None = None
    doubtful: Bool | None = None


def empty_volumes(settings: VolumeSettings) -> list[TsdfVolume]:
    """Returns empty volumes for camera tracking, from the finest to the coarsest."""
    sizes = [settings.voxel * _VOXEL_RATIO**level for level in range(_VOLUME_COUNT)]
    reaches = [settings.reach] + [settings.far] * (_VOLUME_COUNT - 1)
    return [TsdfVolume(settings, size, reach) for size, reach in zip(sizes, reaches, strict=True)]


class Scanner:
    """Tracks one moving camera and fuses its frames into TSDF volumes.

    The first frame defines the world. If it comes with a pose, that pose is used. Otherwise the camera is
    assumed level, at the origin.

    Attributes:
        is_full: True if the memory is full. Images are then only tracked, and the fused surface is kept.

    Raises:
        InputError: if a frame comes from a different camera than the first.
    """

    def __init__(self, settings: ScanSettings | None = None) -> None:
        self.settings = settings or ScanSettings()
        self.volumes = empty_volumes(self.settings.volume)
        self.tracker = CameraTracker(self.volumes, self.settings.tracking)
        self.keyframes = Keyframes()
        self.poses: list[tuple[int, Float]] = []
        self.history = FrameHistory(MAX_HISTORY_MB)
        self._ups: list[Float | None] = []
        self._camera: tuple[Intrinsics, DepthPreparation] | None = None
        self.view: DepthView | None = None
        self._prepared: tuple[DepthFrame, DepthView] | None = None
        self._pose, self._before = np.eye(4), np.eye(4)
        self._state = ScanState.EMPTY
        self.is_full = False

    @property
    def megabytes(self) -> float:
        """Memory of all volumes and of the stored images, in megabytes."""
        return sum(volume.megabytes for volume in self.volumes) + self.history.megabytes

    @property
    def pose(self) -> Float:
        """(4, 4) the camera's pose in the newest image with a known pose."""
        return self._pose

    @property
    def predicted_pose(self) -> Float:
        """(4, 4) the camera's predicted pose in the next image, at constant velocity."""
        return np.asarray(self._pose @ np.linalg.inv(self._before) @ self._pose)

    def add(
        self, frame: DepthFrame, up: Float | None = None, aside: ExcludedPixels | None = None
    ) -> ScanStep:
        """Tracks the camera of a frame, and fuses the image if the pose is reliable.

        Args:
            up: (3,) unit vector, camera frame, that points up according to its accelerometer, or None.
            aside: pixels that are excluded from tracking, or None.
        """
        view, aside = self.prepare_view(frame), aside or ExcludedPixels()
        self.view = view
        if aside.moving is not None:
            view, frame = restrict_view(view, ~aside.moving), _remove_pixels(frame, aside.moving)
        if view.known < self.settings.least_depth:
            return ScanStep(ScanState.EMPTY, self._pose)
        if not self.poses:
            given_pose = frame.world_from_camera
            self._pose = LEVEL_WORLD_FROM_CAMERA.copy() if given_pose is None else np.array(given_pose, float)
            self._pose[:3, :3] = nearest_rotation(self._pose[:3, :3])
            self._before = self._pose
            return self._fuse_image(frame, view, self._pose, None, up)
        if self._state in (ScanState.LOST, ScanState.EMPTY):
            return self._relocalize(view, up)
        alignment = self._track_alignment(view, up, aside.doubtful)
        self._state = (
            ScanState.LOST if self._is_too_far(alignment, frame.time_ns) else self._classify(alignment)
        )
        if self._state is ScanState.UNSURE:
            # Follow the most likely pose even if it is unsure. Otherwise tracking would fail when the camera
            # moves on.
            self._before, self._pose = self._pose, alignment.world_from_camera
        if self._state is not ScanState.SCANNING:
            return ScanStep(self._state, self._pose, alignment)
        return self._fuse_image(frame, view, alignment.world_from_camera, alignment, up)

    def place(self, frame: DepthFrame, world_from_camera: Float) -> ScanStep:
        """Fuses an image at a known camera pose, for example of a stored scan."""
        pose = np.array(world_from_camera, float)
        return self._fuse_image(frame, self.prepare_view(frame), pose, None, None)

    def look_again(self) -> None:
        """Discards the current camera pose, for example after the camera was put down. The camera is then
        relocalized near earlier poses.
        """
        if self.poses:
            self._state = ScanState.LOST

    def close_loops(self) -> LoopClosure | None:
        """Closes loops: corrects the trajectory so that surfaces seen twice coincide, and fuses the images
        again.

        The trajectory stays unchanged if it is already consistent, or if the images agree less well after the
        correction.

        Returns:
            The loop closure result; None if nothing was scanned.
        """
        if self._camera is None or not self.poses:
            return None
        s, poses = self.settings, [pose for _, pose in self.poses]
        closure = correct_trajectory(self.history, poses, self._ups, self._camera[1], s)
        if closure.moved < _MIN_DISPLACEMENT_VOXELS * s.volume.voxel:
            return closure
        volumes, keyframes = self._fuse_again(closure.poses)
        tracker = CameraTracker(volumes, s.tracking)
        if (
            closure.agreement(tracker, closure.poses)
            < closure.agreement(self.tracker, poses) - _MAX_AGREEMENT_LOSS
        ):
            return closure
        self.volumes, self.tracker, self.keyframes = volumes, tracker, keyframes
        self.poses = [(time, pose) for (time, _), pose in zip(self.poses, closure.poses, strict=True)]
        self._pose = self._before = closure.poses[-1]
        return replace(closure, taken=True)

    def _fuse_again(self, poses: list[Float]) -> tuple[list[TsdfVolume], Keyframes]:
        """Returns volumes and keyframes fused from the stored images at other poses.

        If there are very many images, at most every second one is fused. Its weight then also counts for the
        images that are left out.
        """
        volumes, keyframes = empty_volumes(self.settings.volume), Keyframes()
        numbers = self.history.numbers
        every = max(len(numbers) // _MIN_REFUSION_IMAGES, 1)
        frames = self.history.frames(list(numbers)[::every])
        views = compute_ahead((number, self.prepare_view(frame)) for number, frame in frames)
        for count, (number, view) in enumerate(views):
            if every > 1:
                view = replace(view, weights=view.weights * np.float32(every))
            for volume in volumes if every == 1 or count % _COARSE_FUSION_INTERVAL == 0 else volumes[:1]:
                volume.integrate(view, poses[number])
            if count % _CLEANING_INTERVAL == _CLEANING_INTERVAL - 1:
                for volume in volumes:
                    volume.clean()
            keyframes.offer(view, poses[number])
        return volumes, keyframes

    def extract_surface(self, since: int = 0) -> Mesh:
        """Returns the scanned surface, metres, world, from the images with number ``since`` or later."""
        if not since:
            return extract_surface(self.volumes[0])
        volume = TsdfVolume(self.settings.volume)
        for number, frame in self.history.frames():
            if number >= since:
                volume.integrate(self.prepare_view(frame), self.poses[number][1])
        return extract_surface(volume)

    def extract_object(self) -> Mesh:
        """Cuts the object that stands on the floor out of the surface. The result is upright, on y = 0, in
        metres.

        Raises:
            InputError: if no floor was scanned, or no object stands on it.
        """
        surface, cut = self.extract_surface(), self.settings.cut_out
        return cut_out(surface, find_ground(surface), find_focus([p for _, p in self.poses]), cut)

    def prepare_view(self, frame: DepthFrame) -> DepthView:
        """Returns the view of a frame, cached for repeated calls with the same frame."""
        if self._prepared is not None and self._prepared[0] is frame:
            return self._prepared[1]
        if self._camera is None:
            v = self.settings.volume
            self._camera = frame.intrinsics, DepthPreparation(frame.intrinsics, v.noise, v.near, v.far)
        if frame.intrinsics != self._camera[0]:
            problem = "this frame is from another camera than the first frame"
            raise InputError(problem, where=frame.sensor, remedy="Scan with one camera and one image size.")
        colour = frame.colour if self.settings.volume.colour else None
        self._prepared = frame, self._camera[1].prepare(frame.depth, colour)
        return self._prepared[1]

    def _track_alignment(self, view: DepthView, up: Float | None, doubtful: Bool | None = None) -> Alignment:
        """Aligns an image near the predicted pose, and searches more widely if necessary."""
        predicted = self.predicted_pose
        if doubtful is not None:
            alignment = self.tracker.align(restrict_view(view, ~doubtful), predicted, up)
            if self._classify(alignment) is ScanState.SCANNING:
                return alignment
        alignment = self.tracker.align(view, predicted, up)
        if self._classify(alignment) is ScanState.SCANNING:
            return alignment
        wide_alignments = [
            self.tracker.align(view, start, up, _VOLUME_COUNT - 1) for start in (predicted, self._pose)
        ]
        if self._classify(alignment) is ScanState.UNSURE:
            close = (
                self.tracker.align_closely(view, candidate.world_from_camera, up)
                for candidate in (alignment, *wide_alignments)
            )
            sure_candidates = [
                candidate
                for candidate in close
                if candidate.deviation < _SURE_DEVIATION_FACTOR * self.settings.tracking.unsure
            ]
            return max(sure_candidates, key=_fit_score, default=alignment)
        return max((alignment, *wide_alignments), key=_fit_score)

    def _relocalize(self, view: DepthView, up: Float | None) -> ScanStep:
        """Relocalizes a lost camera near its last pose and at similar keyframes."""
        starts = [self._pose, *self.keyframes.find_nearest(view, _KEYFRAMES_PER_FRAME)]
        alignment = max(
            (self.tracker.align(view, start, up, _VOLUME_COUNT - 1) for start in starts), key=_fit_score
        )
        if self._classify(alignment) is not ScanState.SCANNING:
            self._state = ScanState.LOST
            return ScanStep(ScanState.LOST, self._pose, alignment)
        self._pose = self._before = alignment.world_from_camera
        self._state = ScanState.FOUND
        return ScanStep(ScanState.FOUND, self._pose, alignment)

    def _classify(self, alignment: Alignment) -> ScanState:
        """Classifies an alignment as SCANNING, UNSURE or LOST."""
        s = self.settings.tracking
        if alignment.overlap < MIN_OVERLAP_FRACTION or alignment.agreeing < MIN_AGREEING_FRACTION:
            return ScanState.LOST
        return ScanState.UNSURE if alignment.deviation > s.unsure else ScanState.SCANNING

    def _is_too_far(self, alignment: Alignment, time_ns: int) -> bool:
        """Returns True if the camera would have moved faster than a handheld camera can since the last
        image."""
        passed = max(1e-9 * (time_ns - self.poses[-1][0]), _MIN_FRAME_S)
        distance = float(np.linalg.norm(alignment.world_from_camera[:3, 3] - self._pose[:3, 3]))
        return distance > _MAX_CAMERA_SPEED_M_S * passed + _POSITION_TOLERANCE_M

    def _fuse_image(
        self, frame: DepthFrame, view: DepthView, pose: Float, alignment: Alignment | None, up: Float | None
    ) -> ScanStep:
        """Fuses an image at the pose (4, 4), and stores it for loop closure. Returns the result of the
        frame."""
        self._before, self._pose, self._state = self._pose, pose, ScanState.SCANNING
        if self.is_full:
            return ScanStep(ScanState.SCANNING, pose, alignment, has_memory=False)
        self.is_full = not all([volume.integrate(view, pose).has_memory for volume in self.volumes])
        self.history.add(len(self.poses), frame)
        self.poses.append((frame.time_ns, pose))
        self._ups.append(up)
        self.keyframes.offer(view, pose)
        if len(self.poses) % _CLEANING_INTERVAL == 0:
            for volume in self.volumes:
                volume.clean()
        return ScanStep(ScanState.SCANNING, pose, alignment, not self.is_full)


def _remove_pixels(frame: DepthFrame, excluded: Bool) -> DepthFrame:
    """Returns a frame with unknown depth at some half-size pixels (h, w)."""
    height, width = frame.depth.shape
    full_mask = excluded.repeat(2, 0).repeat(2, 1)[:height, :width]
    return replace(frame, depth=np.where(full_mask, 0, frame.depth).astype(frame.depth.dtype))


def _fit_score(alignment: Alignment) -> float:
    """Returns a score for choosing among poses: the agreeing fraction of an image's points in observed space,
    times the overlap fraction. The pose with the highest score is used."""
    return alignment.agreeing * alignment.overlap
