"""The placement of a mesh on the stage: its scale, its heading, and the position of its origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint


@dataclass(frozen=True)
class Placement:
    """A similarity world_from_rest: a scale, then a rotation about +Y, then an offset.

    Attributes:
        scale: factor on the rest mesh.
        yaw: radians about +Y.
        offset: (3,) metres, the position of the rest origin in the world.
    """

    scale: float
    yaw: float
    offset: Float

    @property
    def rotation(self) -> Float:
        """The rotation about +Y as a matrix (3, 3)."""
        return rotation_about_y(self.yaw)

    def to_world(self, points: Float) -> Float:
        """Transforms rest-space points (..., 3) to the world."""
        return np.asarray(self.scale * points @ self.rotation.T + self.offset)

    def to_rest(self, points: Float) -> Float:
        """Transforms world points (..., 3) to the rest space of the mesh."""
        return np.asarray((points - self.offset) @ self.rotation / self.scale)

    def state_to_world(self, linear: Float, positions: Float) -> tuple[Float, Float]:
        """Transforms linear parts (N, 3, 3) and positions (N, 3) from the rest space to the world."""
        return self.scale * self.rotation @ linear, self.to_world(positions)

    def state_to_rest(self, linear: Float, positions: Float) -> tuple[Float, Float]:
        """Transforms linear parts (N, 3, 3) and positions (N, 3) from the world to the rest space."""
        return self.rotation.T @ linear / self.scale, self.to_rest(positions)

    def scale_about(self, factor: float, about: Float) -> Placement:
        """Returns the placement scaled by ``factor`` about a fixed point (3,)."""
        return Placement(self.scale * factor, self.yaw, about + factor * (self.offset - about))


AS_MODELLED = Placement(1.0, 0.0, np.zeros(3))
"""The placement that leaves a mesh as modelled."""


def placement_at_performer(body: Body, mesh_height: float, ratio: float) -> Placement:
    """Returns the placement that puts a mesh at the performer's position. The mesh's height is the
    performer's height times ``ratio``.

    Args:
        mesh_height: metres, height of the rest mesh. Its lowest point is at y = 0.
        ratio: the mesh's height divided by the performer's height.
    """
    return placement_under_hips(body, ratio * body.height / mesh_height)


def placement_under_hips(
    body: Body, scale: float, stand: Float | None = None, front: float = 0.0
) -> Placement:
    """Returns the placement that puts a point of the mesh below the performer's hips, and turns the mesh to
    face in the performer's direction.

    Args:
        scale: metres of the world per metre of the rest mesh.
        stand: (3,) the point on the floor of the rest mesh that is put below the hips, metres. None means the
            origin.
        front: radians about +Y from +Z to the front of the rest mesh.
    """
    hip = body.joints[Joint.HIP_CENTER]
    place = Placement(scale, body_yaw(body) - front, np.array([float(hip[0]), 0.0, float(hip[2])]))
    if stand is None or not stand.any():
        return place
    return Placement(scale, place.yaw, 2 * place.offset - place.to_world(stand))


def shift_left(placement: Placement, metres: float) -> Placement:
    """Returns the placement moved by ``metres`` to the left, as seen from the mesh."""
    left = placement.rotation @ np.array([metres, 0.0, 0.0])
    return Placement(placement.scale, placement.yaw, placement.offset + left)


def body_yaw(body: Body) -> float:
    """Returns the performer's heading, computed from hips and shoulders: radians about +Y from +Z. It is 0 if
    these joints are unknown.
    """
    lefts = [
        body.joints[a] - body.joints[b]
        for a, b in ((Joint.HIP_LEFT, Joint.HIP_RIGHT), (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT))
        if np.isfinite(body.joints[[a, b]]).all()
    ]
    if not lefts:
        return 0.0
    left = np.sum(lefts, axis=0)
    # A person who faces +Z has the left side at +X. Turning by yaw moves +X to (cos, 0, -sin).
    return float(np.arctan2(-left[2], left[0]))


def find_nearest_placement(placement: Placement, rest: Float, shown: Float) -> Placement:
    """Returns the placement that best fits the current mesh. It differs from ``placement`` only by a rotation
    about +Y and a move over the floor.

    Args:
        rest: (N, 3) the nodes at rest, metres.
        shown: (N, 3) the current nodes in the world, metres.
    """
    expected = placement.to_world(rest)
    yaw = yaw_between(expected - expected.mean(0), shown - shown.mean(0))
    rotated = Placement(placement.scale, placement.yaw + yaw, placement.offset)
    step = shown.mean(0) - rotated.to_world(rest).mean(0)
    return Placement(rotated.scale, rotated.yaw, rotated.offset + step * np.array([1.0, 0.0, 1.0]))


def rotation_about_y(yaw: float) -> Float:
    """Returns the rotation (3, 3) by ``yaw`` radians about +Y."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def wrap_angle(angle: float) -> float:
    """Returns an angle in radians, wrapped to -pi .. pi."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def yaw_between(start: Float, end: Float) -> float:
    """Returns the rotation about +Y, in radians, that best aligns the centred points ``start`` (N, 3) with
    ``end`` (N, 3): Procrustes analysis in the floor plane.
    """
    sine = float((end[:, 0] * start[:, 2] - end[:, 2] * start[:, 0]).sum())
    cosine = float((end[:, 0] * start[:, 0] + end[:, 2] * start[:, 2]).sum())
    return float(np.arctan2(sine, cosine)) if sine or cosine else 0.0
