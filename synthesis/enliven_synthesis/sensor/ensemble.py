"""Several performers and furniture in front of one sensor, with the ground truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.camera import world_from_level_camera
from enliven.frames import DepthFrame
from enliven.person import Body
from enliven_synthesis.body.body_sdf import BodyAnatomy
from enliven_synthesis.body.performer import Figure, Performer
from enliven_synthesis.body.rotations import rotation_about_y, round_to_grid
from enliven_synthesis.body.visibility import find_visible_joints
from enliven_synthesis.motion.motion import Motion, place_figure
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import SensorProfile
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.scene import ROOM, Box, cast_room

_STANDING_HEIGHT_M = 0.02
"""Maximum height in metres of a standing foot's sole above the floor. It is less than a sensor's noise."""
_STANDING_SPEED = 0.35
"""Maximum speed in metres per second of the slowest part of a standing foot. All parts of a swinging foot are
faster."""


@dataclass(frozen=True)
class Appearance:
    """One performer in a scene, with a motion, a position and a time.

    Attributes:
        performer: the performer.
        motion: the motion, created for that performer.
        place: (x, z) position in metres, world frame, where the motion begins.
        yaw: radians about +Y; 0 faces a camera that looks along -Z.
        start: scene time in seconds at which the motion begins.
        present: (from, to) interval of scene time in seconds in which the performer is in the room.
    """

    performer: Performer
    motion: Motion
    place: tuple[float, float] = (0.0, -2.7)
    yaw: float = 0.0
    start: float = 0.0
    present: tuple[float, float] = (-math.inf, math.inf)

    def figure(self, time: float) -> Figure | None:
        """Returns the figure at a scene time in seconds, or None while the performer is absent."""
        if not self.present[0] <= time < self.present[1]:
            return None
        return place_figure(self.motion.figure(time - self.start), self.place, self.yaw)


@dataclass(frozen=True)
class GroundTruth:
    """The ground truth of one frame, for P performers, including absent ones.

    Attributes:
        present: (P,) True if the performer is in the room.
        joints: (P, 20, 3) metres, world frame; NaN for an absent performer.
        visible: (P, 20) True if a joint is in the image and in range, and only its own body occludes it.
        contacts: (P, 2) True if the left and the right foot stand on the floor.
        owner: (H, W) int32 number of the performer who is visible at each pixel; -1 for the room.
    """

    present: Bool
    joints: Float
    visible: Bool
    contacts: Bool
    owner: Int32

    def bodies(self) -> list[Body]:
        """Returns the bodies of the present performers, with ids from 1.

        Confidence is 1 for visible joints, and 0 for others.
        """
        return [
            Body(int(p) + 1, self.joints[p], self.visible[p].astype(float))
            for p in np.flatnonzero(self.present)
        ]


class Ensemble:
    """A scene rendered frame by frame. The same scene and number always give the same frame and ground truth.

    Args:
        profile: the sensor.
        cast: the performers in the scene.
        height, tilt: height of the sensor above the floor in metres, and its downward tilt in degrees.
        room: the furniture.
        rate: frames per second, or None for the profile's rate.
        roll: rotation of the sensor about its optical axis in degrees. 180 is upside down.
        told: whether frames contain the sensor's pose ``world_from_camera``.
        place, yaw: position (x, z) of the sensor in metres, and its rotation about +Y in degrees.
    """

    def __init__(
        self,
        profile: SensorProfile,
        cast: tuple[Appearance, ...],
        *,
        height: float = 1.15,
        tilt: float = 5.0,
        roll: float = 0.0,
        room: tuple[Box, ...] = ROOM,
        rate: float | None = None,
        seed: int = 0,
        width: int | None = None,
        noise: bool = True,
        told: bool = True,
        place: tuple[float, float] = (0.0, 0.0),
        yaw: float = 0.0,
    ) -> None:
        self.profile, self.cast = profile, cast
        self.rate = rate or profile.camera.fps
        self.intrinsics = profile.intrinsics(width)
        stand = np.eye(4)
        stand[:3, :3], stand[:3, 3] = rotation_about_y(math.radians(yaw)), (place[0], 0.0, place[1])
        self.world_from_camera = round_to_grid(
            stand @ world_from_level_camera(height, math.radians(tilt), math.radians(roll))
        )
        self.camera_from_world: Float = np.asarray(np.linalg.inv(self.world_from_camera), np.float64)
        self.sensor = f"synthetic {profile.name}"
        self._told = told
        self._anatomies = [BodyAnatomy(a.performer) for a in cast]
        self._renderer = DepthRenderer(self.intrinsics)
        self._noise = DepthNoise(profile, self.intrinsics, seed) if noise else None
        self._room, self._room_material = cast_room(self.intrinsics, self.world_from_camera, room)

    def time_ns(self, index: int) -> int:
        """Returns the sensor's timestamp of a frame in nanoseconds, as an integer."""
        return round(index * 1_000_000_000 / self.rate)

    def frame(self, index: int) -> tuple[DepthFrame, GroundTruth]:
        """Returns the sensor's frame with that number, and its ground truth."""
        time = index / self.rate
        figures = [a.figure(time) for a in self.cast]
        depth, material = self._room.copy(), self._room_material.copy()
        owner = np.full(depth.shape, -1, np.int32)
        for number, (figure, anatomy) in enumerate(zip(figures, self._anatomies, strict=True)):
            if figure is None:
                continue
            room_depth = depth.copy()
            self._renderer.draw(anatomy.place(figure, self.camera_from_world), depth, material)
            owner[depth < room_depth] = number
        image = (
            np.where(depth < 65.0, np.rint(np.minimum(depth, 65.0) * 1000.0), 0.0).astype(np.uint16)
            if self._noise is None
            else self._noise.add_noise(depth, material, index)
        )
        sent_pose = self.world_from_camera if self._told else None
        frame = DepthFrame(
            image, self.intrinsics, self.time_ns(index), self.sensor, world_from_camera=sent_pose
        )
        return frame, self._ground_truth(time, figures, depth, owner)

    def _ground_truth(
        self, time: float, figures: list[Figure | None], depth: Float, owner: Int32
    ) -> GroundTruth:
        count = len(figures)
        joints, visible = np.full((count, 20, 3), np.nan), np.zeros((count, 20), bool)
        contacts = np.zeros((count, 2), bool)
        reach = (self.profile.range.near, self.profile.range.far)
        for p, figure in enumerate(figures):
            if figure is None:
                continue
            performer = self.cast[p].performer
            joints[p] = figure.joints
            visible[p] = find_visible_joints(
                figure.joints, performer, p, depth, owner, self.intrinsics, self.camera_from_world, reach
            )
            contacts[p] = self._find_standing_feet(p, figure, time)
        return GroundTruth(np.array([f is not None for f in figures], bool), joints, visible, contacts, owner)

    def _find_standing_feet(self, p: int, figure: Figure, time: float) -> Bool:
        """Returns (2,) True for each foot of performer ``p`` that stands.

        A standing foot touches the floor and is at rest.
        """
        performer, step = self.cast[p].performer, 1.0 / 120.0
        soles = performer.soles(figure)
        later = self.cast[p].figure(time + step)
        if later is None:
            return np.asarray(soles.min(1) < _STANDING_HEIGHT_M)
        ends = [14, 15], [18, 19]
        speed = np.array(
            [np.linalg.norm(later.joints[e] - figure.joints[e], axis=-1).min() / step for e in ends]
        )
        return np.asarray((soles.min(1) < _STANDING_HEIGHT_M) & (speed < _STANDING_SPEED))
