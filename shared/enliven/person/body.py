"""A tracked person at one time: 20 joints, and the bones between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person.joints import PARENTS, Joint


@dataclass(frozen=True)
class Body:
    """A tracked person at one time.

    Attributes:
        id: the person's id, which does not change while the person is in view.
        joints: (20, 3) float64 metres, world frame, ordered by :class:`Joint`.
        confidence: (20,) float64 in [0, 1]. It is 0 if the joint is only a guess, which must not drive a
            character.
        orientations: (20, 4) unit quaternions, or None. For each joint, the rotation from the bone that ends
            at the joint to the world. For the root, it is the rotation of the pelvis. All are the identity
            for a person who stands upright and faces +Z, with hanging arms and palms to the thighs. In this
            pose, bones of limbs point along -Y, and bones of the trunk along +Y. +Z is the person's front,
            and +X the person's left side.
        contacts: (2,) probability that the left and the right foot stand on the floor, or None if it was not
            estimated. It is 0 if the foot is not visible.
        stature: measured body height from the soles to the crown when standing straight, metres, or None.
    """

    id: int
    joints: Float
    confidence: Float
    orientations: Float | None = None
    contacts: Float | None = None
    stature: float | None = None

    @property
    def height(self) -> float:
        """Body height from the soles to the crown, metres: the stature, or an estimate from the lengths of
        the bones.
        """
        if self.stature is not None:
            return self.stature
        chain = (Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD, Joint.KNEE_LEFT, Joint.ANKLE_LEFT)
        length = sum(float(np.linalg.norm(self.joints[j] - self.joints[PARENTS[j]])) for j in chain)
        hips = self.joints[[Joint.HIP_LEFT, Joint.HIP_RIGHT]].mean(0)
        length += float(np.linalg.norm(self.joints[Joint.HIP_CENTER] - hips))
        return length + HEAD_ABOVE_JOINT + ANKLE_ABOVE_SOLE


HEAD_ABOVE_JOINT = 0.12
"""Distance from the head joint to the crown of an average adult, metres."""
ANKLE_ABOVE_SOLE = 0.08
"""Distance from the ankle joint to the sole of an average adult, metres."""
