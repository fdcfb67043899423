"""The sensor's pose: reported by the sensor, or estimated from the floor. It is estimated again if the sensor
is moved.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import unproject_depth, world_from_level_camera
from enliven.frames import DepthFrame
from enliven_edge.tracking.frame.observation import FrameView, WorkingCamera, world_points
from enliven_edge.tracking.scene.background_model import Agreement
from enliven_edge.tracking.scene.floor import (
    MAX_FLOOR_TILT,
    correct_mounting,
    raise_world_above_floor,
    world_from_floor,
)
from enliven_edge.tracking.settings import SceneSettings

_USUAL_HEIGHT_M = 1.0
"""Assumed height of the sensor in metres before a floor or a person is visible, if the settings contain no
height."""
_LOWEST_QUANTILE = 0.01
"""Quantile of the visible points' heights that is the maximum height of a guessed floor. Lower points are
noise."""
_MAX_GUESSED_HEIGHT_M = 1.8
"""Maximum sensor height in metres that is guessed from the lowest points alone. They may be far away, where
an error of the tilt matters most."""
_POSE_CHANGE = 0.02
"""Maximum change of an entry of a sensor's pose matrix, in metres for the translation. A larger change starts
a new background model."""
_LARGE_POSE_CHANGE = 0.25
"""Maximum change of an entry of the pose matrix for which people are still tracked. After a larger change
they are searched again, because a body predicted at its old position would be fitted to the background.
"""
_FLOOR_SEARCH_FRAMES = 15
"""Frames between two searches for an unknown floor: half a second at 30 frames per second."""
_MAX_FLOOR_CHECKS = 10
"""Maximum number of searches when a known floor is searched again: five seconds at 30 frames per second. If
visitors hide the floor for longer, the known floor is kept.
"""
_MIN_DEPTH_FRACTION = 0.1
"""Minimum fraction of the image with known depth to search for the floor. With less depth the sensor is
starting or covered.
"""
_CORRECTION_INTERVAL_NS = 1_000_000_000
"""Nanoseconds between two corrections of the mounting, which drifts slowly."""
_CORRECTION_GAIN = 0.15
"""Fraction of each correction that is applied. It is small, because the noise of one frame must not move the
world.
"""
_MIN_FARTHER_FRACTION = 0.08
"""Minimum fraction of the background that must appear farther for the sensor to count as moved. People in
front of the background only make pixels nearer."""
_SUSPICIOUS_FRAMES = 3
"""Consecutive frames that must differ from the background model. A single frame may be disturbed."""
_MOVED_FRACTION = 0.3
"""Fraction of the known background that must differ before the sensor counts as moved."""
_CHECK_FRACTION = 0.6
"""Fraction of :data:`_MOVED_FRACTION` above which the floor is checked. It is below 1, because a small
rotation changes fewer pixels.
"""
_CHECK_INTERVAL_FRAMES = 15
"""Number of frames between two checks of the floor: half a second at 30 frames per second."""
_MOVED_ANGLE = np.deg2rad(3.0)
"""Minimum rotation of the floor in radians for the sensor to count as moved. Smaller rotations are noise of
the floor fit.
"""
_MOVED_HEIGHT_M = 0.12
"""Minimum change of the sensor's height in metres for it to count as moved. Smaller changes are noise of the
floor fit.
"""
_MIN_STILL_FRACTION = 0.85
"""Minimum fraction of nearly unchanged pixels between two frames of a sensor at rest. The other pixels may
show moving people."""
_STILL_FRAMES = 3
"""Number of consecutive still frames that end a fall. A single still frame may lie between two movements."""
_MAX_FALL_NS = 3_000_000_000
"""Maximum duration of a fall in nanoseconds. After it, the fall ends even without still frames, because
people may move all the time."""
_MAX_GRAVITY_ANGLE = np.deg2rad(8.0)
"""Maximum angle in radians between the floor's normal and the accelerometer's up direction. Mounting error
and bias are 1 to 3 degrees. A ramp or a table's edge deviates more."""
_MIN_FALLEN_HEIGHT_M = 0.03
"""Minimum height above the floor in metres of a sensor that was knocked over. It may lie on the floor."""
_MAX_TURN = np.deg2rad(30.0)
"""Maximum rotation of the floor's normal in radians between two frames of a fall: 900 degrees per second at
30 Hz."""


class Mounting:
    """The working camera and its pose.

    The pose is found once per sensor, unless the sensor reports its pose with each frame.

    A sensor that reports no pose is monitored. It counts as moved if most of the known background no longer
    matches. While the sensor falls, the floor is tracked from frame to frame, so that the floor is not
    confused with a wall.

    Attributes:
        world_from_camera: (4, 4), None before the first frame.
        is_new_camera: whether the last frame came from another camera.
        has_new_pose: whether the last frame's pose differs enough to learn a new background model.
        needs_people_search: whether the last frame's pose differs enough that people must be searched again,
            too.
        has_new_floor: whether the last frame showed the floor for the first time while people were tracked.
            The people must then be searched again with their feet on the floor. The background model stays
            unchanged.
        down: (3,) the direction of gravity in the camera's frame if there is an accelerometer. It may be set
            at any time.
        is_moving: whether the sensor is falling or being moved; its frames are then unreliable.
    """

    def __init__(self, settings: SceneSettings) -> None:
        self.settings = settings
        self.world_from_camera: Float | None = None
        self.down: Float | None = None
        self.is_new_camera = self.has_new_pose = self.needs_people_search = self.has_new_floor = (
            self.is_moving
        ) = False
        self._camera: WorkingCamera | None = None
        self._pose_stated = self._floor_known = False
        self._guess = settings.height or _USUAL_HEIGHT_M
        self._floor_searches = self._suspicious = self._differing = self._still = self._checks_left = 0
        self._before: Float | None = None
        self._suggested: Float | None = None
        self._fell_ns = self._corrected_ns = 0

    @property
    def is_floor_known(self) -> bool:
        """Returns True if the floor was found, or the sensor reports its pose."""
        return self._floor_known

    @property
    def is_height_known(self) -> bool:
        """Returns True if the height above the floor is known: from the floor, the sensor or the settings."""
        return self._floor_known or self.settings.height > 0.0

    def search_floor_again(self) -> None:
        """Searches the floor again from the next frame on, unless the sensor reports its pose.

        A different floor replaces the known one only if it is found twice.
        """
        self._checks_left, self._floor_searches, self._suggested = _MAX_FLOOR_CHECKS, 0, None

    def raise_guess(self, view: FrameView, metres: float) -> FrameView:
        """Raises the sensor above a guessed floor by ``metres``. Returns the frame in the corrected world."""
        assert self.world_from_camera is not None
        if self.is_height_known or metres == 0.0:
            return view
        view = view.raise_by(metres)
        self.world_from_camera, self._guess = view.world_from_camera, float(view.world_from_camera[1, 3])
        return view

    @property
    def camera(self) -> WorkingCamera:
        """Returns the camera of the reduced image. Available after the first frame."""
        assert self._camera is not None
        return self._camera

    def view(self, frame: DepthFrame, *, no_people: bool) -> FrameView:
        """Returns the frame, reduced to working resolution and converted to the world frame.

        Args:
            frame: the depth frame.
            no_people: whether no person is tracked. If people are tracked, a new floor is accepted only if it
                is found twice.
        """
        self.is_new_camera = self.has_new_pose = self.needs_people_search = self.has_new_floor = False
        if self._camera is None or self._camera.full != frame.intrinsics:
            self._camera = WorkingCamera(frame.intrinsics, self.settings.working_width)
            self.is_new_camera, self.world_from_camera = True, None
            self._guess = self.settings.height or _USUAL_HEIGHT_M
            self._floor_known, self._floor_searches, self._suggested = False, 0, None
            self.is_moving, no_people = False, True
        z = self._camera.reduce(frame.depth)
        self._pose_stated = frame.world_from_camera is not None
        if frame.world_from_camera is not None:
            self._set_stated_pose(np.asarray(frame.world_from_camera, float))
        elif self.is_moving:
            self._track_fall(z, frame.time_ns)
        elif not self._floor_known:
            self._search_floor(z, no_people)
        elif self._checks_left:
            self._check_floor(z)
        assert self.world_from_camera is not None
        points = world_points(z, self._camera.ray, self.world_from_camera)
        return FrameView(frame.time_ns, z, points, self._camera, self.world_from_camera, self.is_height_known)

    def detect_movement(self, view: FrameView, agreement: Agreement, people: Bool) -> None:
        """Detects that the sensor was moved, and corrects drift of the floor plane.

        Args:
            view: the frame.
            agreement: agreement of the frame with the background model.
            people: (h, w) the pixels that belong to people.
        """
        if self._pose_stated:
            return
        differs = agreement.nearer + agreement.farther
        has_enough_pixels = agreement.compared > 0.1 * view.z.size
        moved = differs > _MOVED_FRACTION and agreement.farther > _MIN_FARTHER_FRACTION
        self._suspicious = self._suspicious + 1 if moved and has_enough_pixels else 0
        self._differing = (
            self._differing + 1 if differs > _CHECK_FRACTION * _MOVED_FRACTION and has_enough_pixels else 0
        )
        looked = self._differing % _CHECK_INTERVAL_FRAMES == _SUSPICIOUS_FRAMES
        if self._suspicious >= _SUSPICIOUS_FRAMES or (looked and self._floor_is_elsewhere(view, people)):
            self._differing = 0
            self.is_moving, self._suspicious, self._still = True, 0, 0
            self._before, self._fell_ns = view.z, view.time_ns
        elif self._floor_known and not 0 <= view.time_ns - self._corrected_ns < _CORRECTION_INTERVAL_NS:
            self._corrected_ns = view.time_ns
            assert self.world_from_camera is not None
            usable = ~people & (view.z > 0) & (view.z < self.settings.far)
            self.world_from_camera = correct_mounting(
                self.world_from_camera, view.points, usable, _CORRECTION_GAIN
            )

    @property
    def may_be_moving(self) -> bool:
        """Returns True if enough pixels differ from the background that the sensor may be moving.

        While it returns True, new people are not accepted.
        """
        return self._suspicious > 0

    def _floor_is_elsewhere(self, view: FrameView, people: Bool) -> bool:
        """Returns True if the floor's direction or height relative to the sensor changed.

        A person in front of the sensor does not change them.
        """
        assert self.world_from_camera is not None
        if not self._floor_known:
            return False
        points = unproject_depth(view.z * 1e3, self.camera.ray)[~people & (view.z > 0)]
        pose = world_from_floor(points, self.settings.upside_down)
        if pose is None:
            return False
        return not _is_same_floor(pose, self.world_from_camera)

    def _set_stated_pose(self, stated: Float) -> None:
        """Sets the pose to the (4, 4) pose that the sensor reports."""
        previous_pose = self.world_from_camera
        moved = 0.0 if previous_pose is None else float(np.abs(stated - previous_pose).max())
        self.has_new_pose, self.needs_people_search = moved > _POSE_CHANGE, moved > _LARGE_POSE_CHANGE
        self.world_from_camera, self._floor_known, self.is_moving = stated, True, False

    def _track_fall(self, z: Float, time_ns: int) -> None:
        """Tracks the floor in a frame of a sensor that is being moved, until the image is still."""
        assert self._before is not None
        self._still = (
            self._still + 1 if _compute_unchanged_fraction(z, self._before) > _MIN_STILL_FRACTION else 0
        )
        self._before = z
        self._follow_floor(z)
        if self._still >= _STILL_FRAMES or not 0 <= time_ns - self._fell_ns < _MAX_FALL_NS:
            self.is_moving = False
            self.has_new_pose = self.needs_people_search = True

    def _follow_floor(self, z: Float) -> None:
        """Finds the floor near its pose in the previous frame, or else near the direction in the settings."""
        assert self.world_from_camera is not None
        has_depth = z > 0
        if has_depth.mean() < _MIN_DEPTH_FRACTION:
            return
        points = unproject_depth(z * 1e3, self.camera.ray)[has_depth]
        pose = world_from_floor(
            points, up=self.world_from_camera[1, :3], within=_MAX_TURN, lowest=_MIN_FALLEN_HEIGHT_M
        )
        if pose is None:
            pose = world_from_floor(points, self.settings.upside_down)
        if pose is not None:
            self.world_from_camera, self._floor_known = pose, True

    def _search_floor(self, z: Float, no_people: bool) -> None:
        """Sets the pose from the floor, or from the settings if no floor is found."""
        scene = self.settings
        if self.world_from_camera is None:
            roll = np.pi if scene.upside_down else 0.0
            self.world_from_camera = world_from_level_camera(self._guess, scene.tilt, roll)
        has_depth = z > 0
        if has_depth.mean() < _MIN_DEPTH_FRACTION:
            return  # The camera is still starting, or it is covered.
        self._floor_searches += 1
        if self._floor_searches % _FLOOR_SEARCH_FRAMES != 1:
            return
        points, old_suggestion = unproject_depth(z * 1e3, self.camera.ray)[has_depth], self._suggested
        self._suggested = pose = self._find_floor(points)
        if pose is not None and (
            no_people or (old_suggestion is not None and _is_same_floor(pose, old_suggestion))
        ):
            self.world_from_camera, self._floor_known, self.has_new_floor = pose, True, not no_people
        elif pose is None and no_people:
            self._place_by_guess(points)

    def _check_floor(self, z: Float) -> None:
        """Searches a known floor again. Replaces it by a different floor that is found twice in a row."""
        self._floor_searches += 1
        has_depth = z > 0
        if self._floor_searches % _FLOOR_SEARCH_FRAMES != 1 or has_depth.mean() < _MIN_DEPTH_FRACTION:
            return
        self._checks_left -= 1
        points, old_suggestion = unproject_depth(z * 1e3, self.camera.ray)[has_depth], self._suggested
        self._suggested = self._find_floor(points)
        if self._suggested is None or self.world_from_camera is None:
            return
        if _is_same_floor(self._suggested, self.world_from_camera):
            self._checks_left = 0
        elif old_suggestion is not None and _is_same_floor(self._suggested, old_suggestion):
            self._checks_left = 0
            self.world_from_camera, self.has_new_pose, self.needs_people_search = self._suggested, True, True

    def _find_floor(self, points: Float) -> Float | None:
        """Returns the (4, 4) pose from the floor in (N, 3) camera-frame points. Returns None if no floor is
        found.
        """
        up, within = (None, MAX_FLOOR_TILT) if self.down is None else (-self.down, _MAX_GRAVITY_ANGLE)
        return world_from_floor(
            points, self.settings.upside_down, up=up, within=within, seed=self._floor_searches
        )

    def _place_by_guess(self, points: Float) -> None:
        """Sets the pose without a visible floor.

        Almost no (M, 3) camera-frame point is then below y = 0.
        """
        assert self.world_from_camera is not None
        if self.down is not None:
            self.world_from_camera = raise_world_above_floor(-self.down, self._guess)
        if self.settings.height > 0.0 or self._floor_searches > 1:
            return
        near_points = points[points[:, 2] < self.settings.far]
        if len(near_points):
            pose = self.world_from_camera.copy()
            lowest = float(np.quantile(near_points @ pose[1, :3] + pose[1, 3], _LOWEST_QUANTILE))
            pose[1, 3] = max(self._guess, min(_MAX_GUESSED_HEIGHT_M, pose[1, 3] - lowest))
            self.world_from_camera, self._guess = pose, float(pose[1, 3])


def _is_same_floor(first: Float, second: Float) -> bool:
    """Returns True if two (4, 4) poses of the sensor have the same floor, within detection noise."""
    turned = float(np.arccos(np.clip(first[1, :3] @ second[1, :3], -1.0, 1.0)))
    return turned <= _MOVED_ANGLE and abs(float(first[1, 3] - second[1, 3])) <= _MOVED_HEIGHT_M


def _compute_unchanged_fraction(z: Float, previous_z: Float) -> float:
    """Returns the fraction of nearly unchanged pixels among those known in both frames."""
    is_known = (z > 0) & (previous_z > 0)
    count = max(1, int(np.count_nonzero(is_known)))
    return float(np.count_nonzero(is_known & (np.abs(z - previous_z) < 0.03 + 0.01 * z * z))) / count
