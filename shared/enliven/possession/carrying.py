"""Transforms of a performer's joints from the world into the rest space of the mesh that they move."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from enliven.arrays import Float, Float32
from enliven.person import PARENTS, Body, J, Joint
from enliven.possession.body_in_mesh import BodyInMesh
from enliven.possession.bone_cylinders import bone_rotations, filled_joints
from enliven.possession.placement import Placement, facing, turn_about_y

_HIP = Joint.HIP_CENTER


class Carrying(Protocol):
    """Carries joints from the world into the rest space."""

    @property
    def scale(self) -> float:
        """Metres of the performer for one metre of the rest space."""

    @property
    def fits(self) -> bool:
        """Whether the joints lie in the mesh by themselves, so that every bone should take hold."""

    def __call__(self, joints: Float) -> Float:
        """(20, 3) joints in the rest space, from (20, 3) in the world."""

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """(M, 3) points and (M, 3) normals of the performer's surface in the rest space."""

    def handed_over(self, body: Body) -> None:
        """Continues with another body from where the last one was."""


@dataclass
class CarriedPlacement:
    """Carries joints by a rigid placement with scale: as if the mesh stood where the performer is.

    Attributes:
        placement: where the mesh would have to stand for the performer to be in it.
        travel: share of the performer's travel over the floor that the mesh makes too.
        stays: whether the mesh stands elsewhere: then another performer goes on where the last one was.
        home: (2,) metres, x and z of the hip when the performer took hold.
    """

    placement: Placement
    travel: float = 1.0
    stays: bool = False
    home: Float | None = None
    fits: bool = field(default=False, init=False)
    _hip: Float | None = field(default=None, repr=False)

    @property
    def scale(self) -> float:
        """Metres of the performer for a metre of the rest space."""
        return self.placement.scale

    def __call__(self, joints: Float) -> Float:
        """(20, 3) joints in the rest space, from (20, 3) in the world."""
        if np.isfinite(joints[_HIP]).all():
            self._hip = joints[_HIP, [0, 2]].copy()
            if self.home is None:
                self.home = self._hip
        return self._at_rest(joints)

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """(M, 3) points and (M, 3) normals of the performer's surface in the rest space."""
        return self._at_rest(points), np.asarray(normals @ self.placement.rotation, np.float64)

    def _at_rest(self, points: Float | Float32) -> Float:
        """(M, 3) world points in the rest space, less the travel that the mesh does not make."""
        points = np.array(points, np.float64)
        if self._hip is not None and self.home is not None:
            points[:, [0, 2]] -= (1.0 - self.travel) * (self._hip - self.home)
        return self.placement.to_rest(points)

    def handed_over(self, body: Body) -> None:
        """Continues with another body: where the last one was, or, inside the mesh, where the body is."""
        if self.stays and self._hip is not None and self.home is not None:
            step = body.joints[_HIP, [0, 2]] - self._hip
            if np.isfinite(step).all():
                offset = self.placement.offset + np.array([step[0], 0.0, step[1]])
                self.placement = Placement(self.placement.scale, self.placement.yaw, offset)
                self.home = self.home + step


class Mapped:
    """Limb drives limb: each bone of the mesh's own skeleton turns as the performer's bone has turned.

    Joints are chained down the mesh's skeleton: j = parent + Q R Q^T (rest bone), with R the rotation of the
    performer's bone since they took hold, and Q the rotation from their facing to the mesh's front. The hip
    moves as theirs does, scaled by the ratio of the leg lengths where the mesh has legs.

    Args:
        likeness: the mesh's skeleton.
        body: the performer as they take hold.
        scale: metres of the performer for one metre of the rest space.
        travel: share of their travel over the floor that the mesh makes too.
    """

    fits = True

    def __init__(self, likeness: BodyInMesh, body: Body, scale: float, travel: float = 1.0) -> None:
        self.likeness, self.travel = likeness, travel
        self._rest = filled_joints(body.joints, body.joints)
        self._home = self._rest[_HIP].copy()
        self._last = self._rest
        self._turn = turn_about_y(likeness.yaw - facing(body))
        self.scale, self._measure = scale, scale
        if np.isfinite(likeness.leg):
            self._measure = float(
                np.clip(BodyInMesh(self._rest, 0.0).leg / likeness.leg, scale / 5, 5 * scale)
            )

    def __call__(self, joints: Float) -> Float:
        """(20, 3) joints of the mesh's skeleton, from (20, 3) in the world; NaN where it has none."""
        now = filled_joints(joints, self._last)
        self._last = now
        turns = self._turn @ bone_rotations(self._rest, now)[0] @ self._turn.T
        own = self.likeness.joints
        way = (now[_HIP] - self._home) * np.array([self.travel, 1.0, self.travel])
        out = np.empty((J, 3))
        out[_HIP] = own[_HIP] + self._turn @ way / self._measure
        for child in range(1, J):
            parent = PARENTS[child]
            out[child] = out[parent] + turns[child - 1] @ (own[child] - own[parent])
        return out

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """Returns two empty arrays (0, 3): a person's surface does not lie on a mesh of another shape."""
        return np.empty((0, 3)), np.empty((0, 3))

    def handed_over(self, body: Body) -> None:
        """Continues with another body from where the last one was."""
        step = body.joints[_HIP] - self._last[_HIP]
        if np.isfinite(step).all():
            self._home = self._home + step
            self._last = self._last + step
