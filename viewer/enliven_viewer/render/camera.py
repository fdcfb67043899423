"""Cameras of the scene: an orbit camera for users, and an automatic film camera."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

Box = tuple[Float, Float]
"""Lowest and highest corner, (3,) each, in metres, world frame."""

INITIAL_AZIMUTH = math.radians(32)
"""Initial azimuth in radians about +Y from the front. The subject's front and one side are visible."""
INITIAL_ELEVATION = math.radians(13)
"""Initial elevation of the camera above the horizon, in radians. From this elevation, the position of the
feet on the floor is visible.
"""
MIN_VISIBLE_BOX_FRACTION = 0.96
"""Minimum fraction of a subject's bounding box that must be in view. It is below 1, because subjects do not
fill the corners of their boxes.
"""
MIN_ELEVATION = math.radians(1.0)
"""Minimum elevation in radians above the horizon. From below, the floor is not visible."""
MAX_ELEVATION = math.radians(88)
"""Maximum elevation in radians. Straight down, the camera's up direction would be undefined."""
TURN_PER_PIXEL = 0.008
"""Rotation of the camera in radians per pixel of a drag: half a turn for 400 pixels."""


@dataclass(frozen=True)
class CameraView:
    """A camera at one time.

    Attributes:
        eye: (3,) metres, world frame.
        camera_from_world: (4, 4), OpenGL's camera (+X right, +Y up, -Z forward).
        clip_from_camera: (4, 4) perspective projection.
    """

    eye: Float
    camera_from_world: Float
    clip_from_camera: Float

    @property
    def clip_from_world(self) -> Float:
        """Returns (4, 4) clip_from_camera @ camera_from_world."""
        return np.asarray(self.clip_from_camera @ self.camera_from_world)

    def project(self, points: Float) -> Float:
        """Returns (N, 2) image positions, -1..1 to the right and up, of points (N, 3)."""
        clip = np.c_[points, np.ones(len(points))] @ self.clip_from_world.T
        return np.asarray(clip[:, :2] / clip[:, 3:])


def look_at(eye: Float, target: Float) -> Float:
    """Returns (4, 4) camera_from_world of an upright camera at ``eye`` (3,) that looks at ``target`` (3,)."""
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(back, right), back])
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3] = rotation
    camera_from_world[:3, 3] = -rotation @ eye
    return camera_from_world


def make_perspective(field_of_view: float, aspect: float, near: float, far: float) -> Float:
    """Returns the (4, 4) OpenGL perspective projection. ``field_of_view`` is vertical, in radians."""
    focal = 1 / math.tan(field_of_view / 2)
    depth = near - far
    return np.array(
        [
            [focal / aspect, 0, 0, 0],
            [0, focal, 0, 0],
            [0, 0, (far + near) / depth, 2 * far * near / depth],
            [0, 0, -1, 0],
        ]
    )


def make_orthographic(low: Float, high: Float) -> Float:
    """Returns the (4, 4) OpenGL orthographic projection of a box.

    The box between ``low`` and ``high``, (3,) each, is in the camera frame.
    """
    projection = np.eye(4)
    size = high - low
    projection[[0, 1, 2], [0, 1, 2]] = 2 / size[0], 2 / size[1], -2 / size[2]
    projection[:3, 3] = (
        -(high[0] + low[0]) / size[0],
        -(high[1] + low[1]) / size[1],
        (high[2] + low[2]) / size[2],
    )
    return projection


def find_fitting_distance(box: Box, rows: Float, field_of_view: float, aspect: float) -> float:
    """Returns the distance in metres from a box's centre at which the box just fits into the image.

    Args:
        rows: (3, 3) the camera's axes (right, up, back) in the world.
        field_of_view: vertical, in radians.
    """
    middle = (box[0] + box[1]) / 2
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    right, up, back = rows @ (signs * np.maximum(box[1] - middle, 0.1)).T
    tangent = math.tan(field_of_view / 2)
    needed = np.maximum(np.abs(right) / (tangent * aspect), np.abs(up) / tangent)
    return float((MIN_VISIBLE_BOX_FRACTION * needed + back).max())


class OrbitCamera:
    """A camera on a sphere around a target. :meth:`advance` smooths its movements.

    Args:
        field_of_view: vertical, in radians.
    """

    def __init__(self, field_of_view: float = math.radians(34)) -> None:
        self.field_of_view = field_of_view
        # The elements are the target x, y, z (metres), azimuth and elevation (radians), and the logarithm of
        # the distance (metres).
        self._goal = np.array([0.0, 0.9, 0.0, INITIAL_AZIMUTH, INITIAL_ELEVATION, math.log(5.0)])
        self._now = self._goal.copy()

    def orbit(self, across: float, up: float) -> None:
        """Orbits by ``across`` and ``up`` radians around the target. The camera stays above the floor."""
        self._goal[3] += across
        self._goal[4] = min(max(self._goal[4] + up, MIN_ELEVATION), MAX_ELEVATION)

    @property
    def target(self) -> Float:
        """Returns the current target point (3,) in metres."""
        return self._now[:3].copy()

    def face(self, azimuth: float, elevation: float) -> None:
        """Sets the direction from the target to the camera in radians: azimuth from +Z towards +X, and
        elevation.
        """
        full_turns = round((self._goal[3] - azimuth) / (2 * math.pi))
        self._goal[3] = azimuth + 2 * math.pi * full_turns
        self._goal[4] = min(max(elevation, MIN_ELEVATION), MAX_ELEVATION)

    @property
    def goal(self) -> tuple[float, float, float, float, float, float]:
        """Returns the goal: target (metres), azimuth, elevation (radians), distance (metres)."""
        x, y, z, azimuth, elevation, distance = map(float, self._goal)
        return x, y, z, azimuth, elevation, math.exp(distance)

    def go(self, target: Sequence[float], azimuth: float, elevation: float, distance: float) -> None:
        """Moves to a target point (metres), direction (radians) and distance (metres)."""
        self._goal[:3], self._goal[5] = target, math.log(distance)
        self.face(azimuth, elevation)

    def pan(self, across: float, up: float) -> None:
        """Moves the target by fractions of the image height to the right and up."""
        span = 2 * math.tan(self.field_of_view / 2) * math.exp(self._goal[5])
        rows = look_at(*self._eye_and_target(self._goal))[:3, :3]
        self._goal[:3] += span * (across * rows[0] + up * rows[1])
        self._goal[1] = max(self._goal[1], 0.0)

    def move(self, offset: Float) -> None:
        """Moves the target, and the camera with it, by (3,) metres."""
        self._goal[:3] += offset

    def zoom(self, factor: float) -> None:
        """Multiplies the distance by ``factor`` (0.9 moves closer), limited to 0.2 to 60 metres."""
        distance = self._goal[5] + math.log(factor)
        self._goal[5] = min(max(distance, math.log(0.2)), math.log(60))

    def frame(
        self, box: Box, aspect: float, *, at_once: bool = False, reset: bool = False, margin: float = 1.0
    ) -> None:
        """Frames a whole box. ``reset`` also returns to the initial direction from the front right.

        Args:
            margin: size of the view relative to the box; above 1 leaves space around it.
        """
        self._goal[:3] = (box[0] + box[1]) / 2
        if reset:
            self._goal[3:5] = INITIAL_AZIMUTH, INITIAL_ELEVATION
        rows = look_at(*self._eye_and_target(self._goal))[:3, :3]
        self._goal[5] = math.log(margin * find_fitting_distance(box, rows, self.field_of_view, aspect))
        if at_once:
            self._now[:] = self._goal

    def advance(self, seconds: float) -> None:
        """Moves towards the goal. The difference halves every 60 milliseconds."""
        self._now += (self._goal - self._now) * (1 - 0.5 ** (seconds / 0.06))

    def view(self, aspect: float) -> CameraView:
        """Returns the current camera view."""
        eye, target = self._eye_and_target(self._now)
        distance = math.exp(self._now[5])
        near = max(0.02, distance * 0.02)
        return CameraView(
            eye, look_at(eye, target), make_perspective(self.field_of_view, aspect, near, distance + 80)
        )

    @staticmethod
    def _eye_and_target(state: Float) -> tuple[Float, Float]:
        azimuth, elevation, distance = state[3], state[4], math.exp(state[5])
        level = math.cos(elevation)
        offset = np.array([math.sin(azimuth) * level, math.sin(elevation), math.cos(azimuth) * level])
        eye = state[:3] + distance * offset
        eye[1] = max(eye[1], 0.02)
        return eye, state[:3]


class FilmCamera:
    """A camera that follows its subject smoothly and drifts slightly around it.

    The centre and size of the subject are low-pass filtered. The lag is at most ``slack`` times the subject's
    radius, so that a walking subject stays in view.
    """

    def __init__(
        self,
        field_of_view: float = math.radians(34),
        *,
        delay: float = 1.4,
        drift: float = math.radians(11),
        period: float = 26.0,
        slack: float = 0.3,
    ) -> None:
        self._orbit = OrbitCamera(field_of_view)
        self._delay, self._drift, self._period, self._slack = delay, drift, period, slack
        self._centre: Float | None = None
        self._half = np.zeros(3)
        self._seconds = 0.0

    def follow(self, box: Box, seconds: float, aspect: float) -> None:
        """Advances the filters by ``seconds`` with the subject in ``box``. The first box is
        used unfiltered.
        """
        centre, half_size = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
        if self._centre is None:
            self._centre, self._half = centre.copy(), half_size.copy()
        gain = 1 - math.exp(-seconds / self._delay)
        self._centre += gain * (centre - self._centre)
        self._half += gain * (half_size - self._half)
        lag = self._centre - centre
        limit = self._slack * float(np.linalg.norm(half_size))
        length = float(np.linalg.norm(lag))
        if length > limit:
            self._centre = centre + lag * (limit / length)
        self._half = np.maximum(self._half, 0.9 * half_size)
        self._seconds += seconds
        self._aim(aspect)

    def _aim(self, aspect: float) -> None:
        """Points the camera at the filtered subject, with the current drift."""
        assert self._centre is not None
        box = (self._centre - self._half, self._centre + self._half)
        self._orbit.frame(box, aspect, reset=True)
        phase = 2 * math.pi * self._seconds / self._period
        self._orbit.orbit(self._drift * math.sin(phase), 0.25 * self._drift * math.sin(0.7 * phase))
        self._orbit.advance(10.0)

    def view(self, aspect: float) -> CameraView:
        """Returns the current camera view."""
        return self._orbit.view(aspect)
