"""Performers in the physics world: the position of a standing performer, and the collision spheres of a
body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import BONES, Body, Joint
from enliven.possession import body_yaw

_MAX_SWAY_M = 0.12
"""Maximum sway in metres of a person who stands still."""


@dataclass(frozen=True)
class WorldGround:
    """The position and heading of a performer as a local frame: +X to the performer's left, +Z ahead.

    Attributes:
        at: (3,) metres, on the floor.
        yaw: radians about +Y from +Z to ahead.
    """

    at: Float
    yaw: float

    @property
    def turn(self) -> Float:
        """Returns the (4,) unit quaternion of the yaw."""
        return np.array([np.cos(self.yaw / 2), 0.0, np.sin(self.yaw / 2), 0.0])

    def to_world(self, points: Float) -> Float:
        """Converts (..., 3) points from local coordinates (sideways, up, ahead) to the world."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        rotated = points @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        return np.asarray(rotated + self.at)

    def from_world(self, points: Float) -> Float:
        """Converts (..., 3) points from the world to local coordinates (sideways, up, ahead)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.asarray((points - self.at) @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))


FIXED = WorldGround(np.zeros(3), 0.0)
"""The world's own origin and axes."""


class StandingDetector:
    """Finds the position of a person who stands still.

    It avoids placing the physics world where a person only walks by.

    Args:
        seconds: seconds for which the person must stand still.
        patience: seconds after which the mean position of a moving person is used instead. If 0, it is never
            used.
    """

    def __init__(self, seconds: float, patience: float = 0.0) -> None:
        self.seconds, self.patience = seconds, patience
        self._since: dict[int, tuple[WorldGround, int]] = {}
        self._way: dict[int, list[tuple[WorldGround, int]]] = {}

    def find(self, bodies: list[Body], time_ns: int) -> WorldGround | None:
        """Returns the place of the first person who has stood still, or moved about, for long enough."""
        grounds: dict[int, tuple[WorldGround, int]] = {}
        candidates: dict[int, list[tuple[WorldGround, int]]] = {}
        for body in bodies:
            ground = ground_under(body)
            if ground is None:
                continue
            start = self._since.get(body.id, (ground, time_ns))
            if np.linalg.norm(ground.at - start[0].at) > _MAX_SWAY_M:
                start = ground, time_ns
            grounds[body.id] = start
            if (time_ns - start[1]) * 1e-9 >= self.seconds:
                return ground
            path = candidates[body.id] = [*self._way.get(body.id, ()), (ground, time_ns)]
            if self.patience and (time_ns - path[0][1]) * 1e-9 >= self.patience:
                return _mean_place([place for place, _ in path])
        self._since, self._way = grounds, candidates
        return None


def _mean_place(places: list[WorldGround]) -> WorldGround:
    """Returns the mean position and the mean heading of several places."""
    ahead = np.mean([(np.sin(place.yaw), np.cos(place.yaw)) for place in places], axis=0)
    return WorldGround(np.mean([place.at for place in places], axis=0), float(np.arctan2(*ahead)))


def ground_under(body: Body) -> WorldGround | None:
    """Returns the place of a performer, or None if the hips are unknown."""
    hip = body.joints[Joint.HIP_CENTER]
    if not np.isfinite(hip).all() or body.confidence[Joint.HIP_CENTER] <= 0:
        return None
    return WorldGround(np.array([float(hip[0]), 0.0, float(hip[2])]), body_yaw(body))


def _joint_radii() -> Float:
    """Returns the radius (20,) in metres around each joint of a person 1.75 m tall."""
    radii = np.full(len(Joint), 0.07)
    radii[[Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER]] = 0.13
    radii[[Joint.HIP_LEFT, Joint.HIP_RIGHT]] = 0.11
    radii[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HEAD]] = 0.10
    radii[[Joint.KNEE_LEFT, Joint.KNEE_RIGHT]] = 0.08
    radii[[Joint.ELBOW_LEFT, Joint.ELBOW_RIGHT, Joint.WRIST_LEFT, Joint.WRIST_RIGHT]] = 0.055
    return radii


_RADII = _joint_radii()
_SPHERE_FRACTIONS = np.array([1 / 3, 2 / 3])
"""Relative positions of a bone's two spheres along its length."""


def body_spheres(body: Body) -> tuple[Float, Float]:
    """Returns (S, 3) centres and (S,) radii in metres: one sphere at each joint, two along each bone.

    The spheres of a joint that is not finite are not finite either.
    """
    start, end = np.array(BONES).T
    size = float(np.clip(body.height / 1.75, 0.3, 1.6)) if np.isfinite(body.joints).all() else 1.0
    path = body.joints[end] - body.joints[start]
    bone = [body.joints[start] + fraction * path for fraction in _SPHERE_FRACTIONS]
    radii = [_RADII[start] + fraction * (_RADII[end] - _RADII[start]) for fraction in _SPHERE_FRACTIONS]
    return np.concatenate([body.joints, *bone]), size * np.concatenate([_RADII, *radii])
