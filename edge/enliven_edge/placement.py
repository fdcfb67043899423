"""Where a mesh stands on the stage: how large, which way it faces, where its origin is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.body import Body, Joint


@dataclass(frozen=True)
class Placement:
    """world_from_rest as a similarity: scale, then a turn about +Y, then an offset.

    Attributes:
        scale: factor on the rest mesh.
        yaw: radians about +Y.
        offset: (3,) metres, where the rest origin stands.
    """

    scale: float
    yaw: float
    offset: Float

    @property
    def rotation(self) -> Float:
        """(3, 3) the turn about +Y."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    def to_world(self, points: Float) -> Float:
        """(..., 3) rest-space points in the world."""
        return np.asarray(self.scale * points @ self.rotation.T + self.offset)

    def to_rest(self, points: Float) -> Float:
        """(..., 3) world points in the rest space of the mesh."""
        return np.asarray((points - self.offset) @ self.rotation / self.scale)


AS_MODELLED = Placement(1.0, 0.0, np.zeros(3))


def meeting(body: Body, mesh_height: float, ratio: float) -> Placement:
    """The placement that puts a mesh where the performer stands, as tall as they are times ``ratio``.

    The rest origin goes to the floor under the hips, the mesh's +Z to where the performer faces.

    Args:
        mesh_height: metres of the rest mesh, its floor at y = 0.
        ratio: the mesh's height over the performer's.
    """
    hip = body.joints[Joint.HIP_CENTER]
    return Placement(
        ratio * body.height / mesh_height, facing(body), np.array([float(hip[0]), 0.0, float(hip[2])])
    )


def facing(body: Body) -> float:
    """Radians about +Y from +Z to the performer's front, by hips and shoulders; 0 where unknown."""
    left = sum(
        body.joints[a] - body.joints[b]
        for a, b in ((Joint.HIP_LEFT, Joint.HIP_RIGHT), (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT))
        if np.isfinite(body.joints[[a, b]]).all()
    )
    if np.ndim(left) == 0:
        return 0.0
    # A person who faces +Z has the left side at +X; turning by yaw takes +X to (cos, 0, -sin).
    return float(np.arctan2(-left[2], left[0]))
