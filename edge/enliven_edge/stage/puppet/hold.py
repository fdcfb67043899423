"""One performer's hold on a puppet: the control points that they move, and their last pose."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint, mirrored
from enliven_edge.stage.puppet.bones import Bones
from enliven_edge.stage.puppet.locomotion import Feet, Footing, height_of
from enliven_edge.stage.puppet.retargeting import Retargeting

_MIRROR = np.zeros(3), np.array([1.0, 0.0, 0.0])
"""A point and the unit normal of the plane x = 0, in which a performer is mirrored."""


@dataclass
class ControlPointHold:
    """The control points that one performer moves.

    Attributes:
        body: the performer's id.
        points: numbers of the control points.
        bones, feet: follow the performer's bones and feet.
        pose: (P, 3) metres, the last positions of all paired joints in the body frame.
        yaw: radians that the performer faces, continuous.
        footing: how the performer stood last.
        way: (2,) beside and ahead, where the performer's hips were last, in their own heights.
        seen_ns: nanoseconds of the sensor's clock when the performer was last in view.
    """

    body: int
    points: frozenset[int]
    bones: Bones
    feet: Feet = field(default_factory=Feet)
    pose: Float = field(default_factory=lambda: np.zeros((0, 3)))
    yaw: float = 0.0
    footing: Footing = field(default_factory=Footing)
    way: Float = field(default_factory=lambda: np.zeros(2))
    seen_ns: int = 0

    def see(self, body: Body, retargeting: Retargeting, time_ns: int, *, mirror: bool) -> None:
        """Updates the pose and the footing from a performer in view."""
        seconds = max(time_ns - self.seen_ns, 0) * 1e-9
        if mirror:
            body = mirrored(body, *_MIRROR)
        seen = self.bones.see(body, seconds)
        self.pose, self.yaw, self.seen_ns = retargeting.pose(seen), seen.yaw, time_ns
        self.footing = self.feet.see(body, seconds)
        hips = body.joints[Joint.HIP_CENTER, [0, 2]]
        if body.confidence[Joint.HIP_CENTER] > 0 and np.isfinite(hips).all():
            self.way = hips / height_of(body)

    def away(self, time_ns: int) -> float:
        """Returns the seconds since, or until, the performer was last in view: the clock may go back."""
        return abs(time_ns - self.seen_ns) * 1e-9
