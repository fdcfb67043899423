"""How a performer's joints come into the rest space of the mesh that they move."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from enliven.arrays import Float
from enliven.body import Body, Joint
from enliven_edge.placement import Placement

_HIP = Joint.HIP_CENTER


class Carrying(Protocol):
    """Carries joints from the world into the rest space."""

    @property
    def scale(self) -> float:
        """Metres of the performer for a metre of the rest space."""

    def __call__(self, joints: Float) -> Float:
        """(20, 3) joints in the rest space, from (20, 3) in the world."""

    def handed_over(self, body: Body) -> None:
        """Another body goes on from where the last one was."""


@dataclass
class Placed:
    """As if the mesh stood at ``placement``, where the performer is.

    Attributes:
        placement: where the mesh would have to stand for the performer to be in it.
        travel: share of the way over the floor that is carried over.
        stays: whether the mesh stands elsewhere: then another performer goes on where the last one was.
        home: (2,) metres, x and z of the hip when taking hold, where the way begins.
    """

    placement: Placement
    travel: float = 1.0
    stays: bool = False
    home: Float | None = None
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
        joints = np.array(joints, np.float64)
        if self._hip is not None and self.home is not None:
            joints[:, [0, 2]] -= (1.0 - self.travel) * (self._hip - self.home)
        return self.placement.to_rest(joints)

    def handed_over(self, body: Body) -> None:
        """Another body goes on from where the last one was; in the mesh, from where it is itself."""
        if self.stays and self._hip is not None and self.home is not None:
            step = body.joints[_HIP, [0, 2]] - self._hip
            if np.isfinite(step).all():
                offset = self.placement.offset + np.array([step[0], 0.0, step[1]])
                self.placement = Placement(self.placement.scale, self.placement.yaw, offset)
                self.home = self.home + step
