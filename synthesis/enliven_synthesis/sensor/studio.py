"""A performer in a room in front of a sensor, rendered frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, UInt16
from enliven.camera import world_from_level_camera
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.person import Body
from enliven.settings import group, setting
from enliven_synthesis.body.body_sdf import BodyAnatomy
from enliven_synthesis.body.performer import Figure, Performer, Proportions
from enliven_synthesis.body.rotations import rotation_about_y, round_to_grid
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.sensor.noise import DepthNoise
from enliven_synthesis.sensor.profile import SensorProfile
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.scene import cast_room


@dataclass(frozen=True)
class SyntheticSettings:
    """The choreography, the performer and the sensor."""

    choreography: str = setting("chair", "Name of the performer's motion.")
    performer: Proportions = group(Proportions, "Body proportions of the performer.")
    camera_height: float = setting(1.15, "Height of the sensor above the floor.", unit="m", low=0.1, high=3.0)
    camera_tilt: float = setting(5.0, "Downward tilt of the sensor.", unit="deg", low=-45, high=60)
    camera_x: float = setting(0.0, "Sensor position along the world's x axis.", unit="m", low=-20, high=20)
    camera_z: float = setting(0.0, "Sensor position along the world's z axis.", unit="m", low=-20, high=20)
    camera_yaw: float = setting(
        0.0, "Rotation of the sensor to the left. 0 looks along -Z.", unit="deg", low=-180, high=180
    )
    noise: bool = setting(True, "Simulates the noise and faults of the sensor's profile.")
    seed: int = setting(
        0,
        "Random seed of the noise. Each seed simulates another sensor of the same model.",
        low=0,
        high=2**31,
    )
    width: int = setting(
        0, "Width of the images. 0 uses the width of the profile.", unit="px", low=0, high=4096
    )


class SyntheticStudio:
    """Renders frames by number. The same settings and number always give the same frame.

    Args:
        profile: the sensor.
        settings: the choreography, the performer and the sensor's position.

    Raises:
        InputError: if the choreography is unknown, or the width does not scale the image evenly.
    """

    def __init__(self, profile: SensorProfile, settings: SyntheticSettings | None = None) -> None:
        self.profile, self.settings = profile, settings or SyntheticSettings()
        s = self.settings
        self.intrinsics = profile.intrinsics(_check_width(profile, s.width))
        self.choreography = get_choreography(s.choreography)
        stand = np.eye(4)
        stand[:3, :3], stand[:3, 3] = (
            rotation_about_y(math.radians(s.camera_yaw)),
            (s.camera_x, 0.0, s.camera_z),
        )
        self.world_from_camera = round_to_grid(
            stand @ world_from_level_camera(s.camera_height, math.radians(s.camera_tilt))
        )
        self._camera_from_world = _invert_pose(self.world_from_camera)
        self._performer = Performer(s.performer)
        self._anatomy = BodyAnatomy(self._performer)
        self._room, self._room_material = cast_room(self.intrinsics, self.world_from_camera)
        self._renderer = DepthRenderer(self.intrinsics)
        self._noise = DepthNoise(profile, self.intrinsics, s.seed)
        self.sensor = f"synthetic {profile.name}"

    @property
    def frames(self) -> int:
        """Returns the number of frames in one run of the choreography."""
        return round(self.choreography.duration * self.profile.camera.fps)

    def time_ns(self, index: int) -> int:
        """Returns the sensor's timestamp of a frame in nanoseconds, as an integer."""
        return round(index * 1_000_000_000 / self.profile.camera.fps)

    def figure(self, time: float) -> Figure:
        """Returns the performer's figure at a time in seconds. The choreography repeats."""
        return self._performer.pose(self.choreography.posture(time % self.choreography.duration))

    def body(self, time_ns: int) -> Body:
        """Returns the true joints at a time of the sensor's clock."""
        return Body(1, self.figure(time_ns * 1e-9).joints, np.ones(20))

    def frame(self, index: int) -> DepthFrame:
        """Returns the sensor's frame with that number."""
        figure = self.figure(self.time_ns(index) * 1e-9)
        depth, material = self._room.copy(), self._room_material.copy()
        self._renderer.draw(self._anatomy.place(figure, self._camera_from_world), depth, material)
        image = (
            self._noise.add_noise(depth, material, index) if self.settings.noise else _to_millimetres(depth)
        )
        return DepthFrame(
            image, self.intrinsics, self.time_ns(index), self.sensor, world_from_camera=self.world_from_camera
        )


def _invert_pose(rigid: Float) -> Float:
    """Returns the (4, 4) inverse of a rigid transform. The order of additions is fixed."""
    inverse = np.eye(4)
    inverse[:3, :3] = rigid[:3, :3].T
    r, t = rigid[:3, :3], rigid[:3, 3]
    inverse[:3, 3] = -(r[0] * t[0] + r[1] * t[1] + r[2] * t[2])
    return inverse


def _to_millimetres(depth: Float) -> UInt16:
    """Converts a depth in metres to (H, W) uint16 millimetres. Rays without a surface get 0."""
    return np.where(depth < 65.0, np.rint(np.minimum(depth, 65.0) * 1000.0), 0.0).astype(np.uint16)


def _check_width(profile: SensorProfile, width: int) -> int | None:
    """Returns the width of the images in pixels, or None for the profile's width."""
    if width == 0:
        return None
    if width < 16 or width * profile.camera.height % profile.camera.width:
        raise InputError(
            f"the width {width} does not divide the image size "
            f"{profile.camera.width}x{profile.camera.height} evenly",
            where=profile.name,
            remedy=f"Use the width {profile.camera.width}, half of this width or a quarter of this width.",
        )
    return width
