"""One performer's hold on a puppet: the control points that the performer moves, and the last pose."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.examples.spacetime.following import complex_from_floor
from enliven.person import Body, Joint, mirror_body
from enliven_edge.stage.puppet.bones import BoneTracker
from enliven_edge.stage.puppet.locomotion import FootDetector, Footing, leg_length
from enliven_edge.stage.puppet.retargeting import Retargeting

_MIRROR = np.zeros(3), np.array([1.0, 0.0, 0.0])
"""Point and unit normal of the plane x = 0, in which performers are mirrored."""


@dataclass
class ControlPointHold:
    """The control points that one performer moves.

    Attributes:
        body: the performer's id.
        points: indices of the control points.
        bones, feet: the trackers of the performer's bones and feet.
        pose: (P, 3) metres, the last positions of all paired joints in the body frame.
        yaw: the performer's facing direction in radians, without jumps of a whole turn.
        footing: the performer's last foot contacts and jump height.
        path_position: the performer's path on the floor as x + iz, in metres, scaled to the performer of the
            key poses.
        seen_ns: nanoseconds of the sensor's clock when the performer was last in view.
    """

    body: int
    points: frozenset[int]
    bones: BoneTracker
    feet: FootDetector = field(default_factory=FootDetector)
    pose: Float = field(default_factory=lambda: np.zeros((0, 3)))
    yaw: float = 0.0
    footing: Footing = field(default_factory=Footing)
    path_position: complex = 0j
    seen_ns: int = 0
    _hips: complex | None = None
    _legs: list[float] = field(default_factory=lambda: [0.0, 0.0])

    def update(self, body: Body, retargeting: Retargeting, time_ns: int, *, mirror: bool) -> None:
        """Updates the pose and the footing from a performer in view."""
        seconds = max(time_ns - self.seen_ns, 0) * 1e-9
        if mirror:
            body = mirror_body(body, *_MIRROR)
        seen = self.bones.update(body, seconds)
        self.pose, self.yaw, self.seen_ns = retargeting.compute_pose(seen), seen.yaw, time_ns
        self.footing = self.feet.update(body, seconds)
        self._add_step(body, retargeting.legs)

    def _add_step(self, body: Body, legs: float) -> None:
        """Adds the step of the hips to the path, scaled to the size of the performer of the key poses.

        Args:
            legs: metres, the leg length of the performer of the key poses.
        """
        total, frames = self._legs
        self._legs = [total + leg_length(body), frames + 1.0]
        hip_centre = body.joints[Joint.HIP_CENTER]
        if body.confidence[Joint.HIP_CENTER] > 0 and np.isfinite(hip_centre).all():
            hips = complex(complex_from_floor(hip_centre))
            if self._hips is not None:
                self.path_position += (hips - self._hips) * legs * self._legs[1] / self._legs[0]
            self._hips = hips

    def seconds_away(self, time_ns: int) -> float:
        """Returns the seconds since the performer was last in view.

        The result is never negative, even if the sensor's clock runs backwards.
        """
        return abs(time_ns - self.seen_ns) * 1e-9
