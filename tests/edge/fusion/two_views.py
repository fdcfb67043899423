"""Renders a scene with two depth cameras at unknown poses, with ground truth."""

import dataclasses

import numpy as np

from enliven.frames import DepthFrame
from enliven.space.rigid_transform import invert
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.dance import START_Z_M
from enliven_synthesis.motion.motion import DanceMotion
from enliven_synthesis.motion.wander import wander
from enliven_synthesis.sensor.ensemble import Appearance, Ensemble
from enliven_synthesis.sensor.profile import load_profile

WIDTH, RATE = 320, 30.0
PLACES = {"left": ((0.0, 0.0), 0.0), "right": ((2.3, -1.2), 55.0)}
CLOCKS = {"left": 50.0, "right": 57.0}
"""Seconds by which each sensor's clock is ahead of the scene's clock."""
PHASE = 0.4
"""Exposure delay of the second sensor, as a fraction of a frame."""


def walker(duration: float = 16.0, height: float = 1.78, start: float = 0.0, **way) -> Appearance:
    """Returns a person that walks about."""
    performer = Performer(Proportions(height=height))
    motion = DanceMotion(performer, wander(duration, **way), repeat=True)
    return Appearance(performer, motion, (0.0, START_Z_M), start=start)


class View:
    """Returns the frames of one of the two sensors."""

    def __init__(self, name: str, cast: tuple[Appearance, ...], seed: int = 0, noise: bool = True) -> None:
        place, yaw = PLACES[name]
        self.name = name
        self._later = PHASE / RATE if name == "right" else 0.0
        shifted = tuple(dataclasses.replace(a, start=a.start - self._later) for a in cast)
        profile = load_profile("kinect1")
        self.ensemble = Ensemble(
            profile, shifted, rate=RATE, width=WIDTH, told=False, place=place, yaw=yaw, seed=seed, noise=noise
        )
        self.ensemble.sensor = name

    def frame(self, index: int) -> DepthFrame:
        """Returns a frame with the sensor's own timestamp."""
        frame, _ = self.ensemble.frame(index)
        return dataclasses.replace(frame, time_ns=round((self.room_time(index) + CLOCKS[self.name]) * 1e9))

    def room_time(self, index: int) -> float:
        """Returns the scene's time of a frame in seconds."""
        return index / RATE + self._later

    @property
    def world_from_camera(self) -> np.ndarray:
        return self.ensemble.world_from_camera


def left_from_right_camera() -> np.ndarray:
    """Returns the (4, 4) pose that calibration should find: the right camera in the left camera's frame."""
    left, right = (View(name, ()) for name in PLACES)
    return invert(left.world_from_camera) @ right.world_from_camera
