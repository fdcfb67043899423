"""A person's skeleton within a mesh."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.person import PARENTS, Joint

_MAX_PERSON_COST = 45.0
"""Maximum cost of the five ends of a mesh that is certainly a person. A bear has a cost of 35, and a chair
with arm rests 56."""


@dataclass(frozen=True)
class BodyInMesh:
    """A person's skeleton within a mesh.

    Attributes:
        joints: (20, 3) metres, rest space. NaN for joints that the mesh does not have.
        yaw: radians about +Y from +Z to the mesh's front.
        human: True if the mesh is built like a person: a head, two arms, two legs and an upright trunk.
        ends: (5, 3) the ends of head, left and right hand, left and right foot, metres. Empty if the mesh is
            not human-like or the ends were not searched.
        doubts: a sentence about each property that is uncertain.
        strangeness: 0 for a person of usual proportions that stands upright. Less human-like meshes have
            higher values.
    """

    joints: Float
    yaw: float
    human: bool = False
    ends: Float = field(default_factory=lambda: np.empty((0, 3)))
    doubts: tuple[str, ...] = ()
    strangeness: float = 0.0

    @classmethod
    def from_joints(cls, joints: Float) -> BodyInMesh:
        """Returns the skeleton of a person with known joints (20, 3), metres in the rest space."""
        lefts = (
            joints[[Joint.HIP_LEFT, Joint.SHOULDER_LEFT]] - joints[[Joint.HIP_RIGHT, Joint.SHOULDER_RIGHT]]
        )
        left = lefts.sum(0)
        # A person who faces +Z has the left side at +X.
        return cls(joints, float(np.arctan2(-left[2], left[0])), human=True)

    @property
    def is_certain(self) -> bool:
        """True if the mesh is certainly a person. It is then treated as a person by default."""
        return self.human and not self.doubts and self.strangeness < _MAX_PERSON_COST

    @property
    def leg_length(self) -> float:
        """Distance from hip to ankle, metres: the mean of both legs. NaN without legs."""
        lengths = [
            np.linalg.norm(self.joints[j] - self.joints[PARENTS[j]])
            for j in (Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT)
        ]
        return float(np.sum(lengths) / 2)
