"""Transforms of a performer's joints from the world into the rest space of a mesh."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from enliven.arrays import Float, Float32
from enliven.person import Body, Joint
from enliven.possession.placement import Placement

_HIP_JOINT = Joint.HIP_CENTER


class RestTransform(Protocol):
    """The interface of a transform of joints from the world into the rest space."""

    @property
    def scale(self) -> float:
        """Metres of the performer per metre of the rest space."""

    @property
    def fits(self) -> bool:
        """True if the joints are already inside the mesh, so every bone should attach."""

    @property
    def at_rest(self) -> Float | None:
        """(20, 3) metres, the joint positions at which the bones attach to the mesh at rest. If None, the
        current joints are used.
        """

    @property
    def turns(self) -> Float | None:
        """(19, 3, 3) rotation of each bone for the last joints. If None, the caller computes the rotations
        from the joints.
        """

    def set_time(self, time_ns: int) -> None:
        """Sets the time of the joints that are transformed next, in nanoseconds of the sensor's clock."""

    def __call__(self, joints: Float) -> Float:
        """Returns (20, 3) joints in the rest space, from (20, 3) in the world."""

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """Returns (M, 3) points and (M, 3) normals of the performer's surface in the rest space."""

    def hand_over_to(self, body: Body) -> None:
        """Continues with another body from the last position of the previous body."""


@dataclass
class PlacementTransform:
    """A similarity transform that converts joints as if the mesh stood at the performer's position.

    Attributes:
        placement: the placement that the mesh would need for the performer to be inside it.
        travel: fraction of the performer's travel over the floor that the mesh follows.
        is_elsewhere: True if the mesh is not at the performer's position. In this case the mesh continues
            from its last position if another performer takes over.
        home: (2,) x and z of the hip at the time of attaching, metres.
    """

    placement: Placement
    travel: float = 1.0
    is_elsewhere: bool = False
    home: Float | None = None
    fits: bool = field(default=False, init=False)
    at_rest: Float | None = field(default=None, init=False)
    turns: Float | None = field(default=None, init=False)
    _hip: Float | None = field(default=None, repr=False)

    @property
    def scale(self) -> float:
        """Metres of the performer per metre of the rest space."""
        return self.placement.scale

    def set_time(self, time_ns: int) -> None:
        """Does nothing: this transform does not depend on time."""

    def __call__(self, joints: Float) -> Float:
        """Returns (20, 3) joints in the rest space, from (20, 3) in the world."""
        if np.isfinite(joints[_HIP_JOINT]).all():
            self._hip = joints[_HIP_JOINT, [0, 2]].copy()
            if self.home is None:
                self.home = self._hip
        return self._to_rest_space(joints)

    def surface(self, points: Float | Float32, normals: Float | Float32) -> tuple[Float, Float]:
        """Returns (M, 3) points and (M, 3) normals of the performer's surface in the rest space."""
        return self._to_rest_space(points), np.asarray(normals @ self.placement.rotation, np.float64)

    def _to_rest_space(self, points: Float | Float32) -> Float:
        """Transforms world points (M, 3) to the rest space, and removes the travel that the mesh does not
        follow.
        """
        points = np.array(points, np.float64)
        if self._hip is not None and self.home is not None:
            points[:, [0, 2]] -= (1.0 - self.travel) * (self._hip - self.home)
        return self.placement.to_rest(points)

    def hand_over_to(self, body: Body) -> None:
        """Continues with another body. If the mesh is not at the performer's position, it continues from its
        last position. Otherwise it moves to the position of the new body.
        """
        if self.is_elsewhere and self._hip is not None and self.home is not None:
            step = body.joints[_HIP_JOINT, [0, 2]] - self._hip
            if np.isfinite(step).all():
                offset = self.placement.offset + np.array([step[0], 0.0, step[1]])
                self.placement = Placement(self.placement.scale, self.placement.yaw, offset)
                self.home = self.home + step
