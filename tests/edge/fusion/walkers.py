"""Walking people, as seen by error-free sensors at any position."""

import numpy as np

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.space.rigid_transform import (
    compose_transform,
    invert,
    rotation_from_vector,
    transform_points,
)
from enliven_edge.fusion.live.side_assignment import swap_sides
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.wander import WalkPath

FORWARD = np.array([0.0, 0.0, 1.0])


def stand(x: float, z: float, degrees: float, tilt: float = 0.0) -> np.ndarray:
    """Returns (4, 4) world_from_sensor of a level frame at (x, z), rotated about +Y (0 looks along -Z)."""
    yaw = rotation_from_vector(np.deg2rad(degrees) * np.array([0.0, 1.0, 0.0]))
    return compose_transform(
        yaw @ rotation_from_vector(np.deg2rad(tilt) * np.array([1.0, 0.0, 0.0])), np.array([x, 0.0, z])
    )


class Walker:
    """One person walking along a path."""

    def __init__(self, way: WalkPath | None = None, height: float = 1.75, shift=(0.0, 0.0)) -> None:
        self.way, self.performer = way or WalkPath(), Performer(Proportions(height=height))
        self.shift = np.array([shift[0], 0.0, shift[1]])

    def joints(self, time: float) -> np.ndarray:
        """Returns (20, 3) joint positions in the world, metres."""
        return self.performer.pose(self.way.posture(time)).joints + self.shift


def told(
    walkers: list[Walker],
    world_from_sensor: np.ndarray,
    times: np.ndarray,
    *,
    clock: float = 0.0,
    sensor: str = "a",
    noise: float = 0.0,
    swapped=lambda time: False,
    ids=None,
    seed: int = 0,
) -> list[BodyFrame]:
    """Returns body frames in the sensor's own frame and clock. ``clock`` is its lead over the world's,
    seconds.
    """
    random = np.random.default_rng(seed)
    sensor_from_world = invert(world_from_sensor)
    frames = []
    for time in times:
        bodies = []
        for number, walker in enumerate(walkers):
            joints = transform_points(sensor_from_world, walker.joints(float(time)))
            joints = joints + noise * random.standard_normal((20, 3))
            body = Body(number if ids is None else ids[number], joints, np.ones(20))
            bodies.append(swap_sides(body) if swapped(time) else body)
        frames.append(BodyFrame(bodies, round((time + clock) * 1e9), sensor))
    return frames
