"""One performer's hold on a puppet: the control points that they move, and what they did last."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, mirrored
from enliven_edge.stage.puppet.bones import Bones
from enliven_edge.stage.puppet.feet import Footing, Soles
from enliven_edge.stage.puppet.likeness import Likeness

_MIRROR = np.zeros(3), np.array([1.0, 0.0, 0.0])


@dataclass
class Hold:
    """What one performer moves.

    Attributes:
        body: the performer's id.
        points: numbers of the control points.
        bones, soles: follow them.
        pose: (P, 3) metres, the paired joints in the body frame, all of them, as they were last.
        yaw: radians that the performer faces, continuous.
        footing: how they stood last.
        seen_ns: when that was, the sensor's clock.
    """

    body: int
    points: frozenset[int]
    bones: Bones
    soles: Soles = field(default_factory=Soles)
    pose: Float = field(default_factory=lambda: np.zeros((0, 3)))
    yaw: float = 0.0
    footing: Footing = field(default_factory=Footing)
    seen_ns: int = 0

    def see(self, body: Body, likeness: Likeness, time_ns: int, *, mirror: bool) -> None:
        """The performer is in view."""
        seconds = max(time_ns - self.seen_ns, 0) * 1e-9
        if mirror:
            body = mirrored(body, *_MIRROR)
        seen = self.bones.see(body, seconds)
        self.pose, self.yaw, self.seen_ns = likeness.pose(seen), seen.yaw, time_ns
        self.footing = self.soles.see(body, seconds)

    def away(self, time_ns: int) -> float:
        """Seconds since they were last in view; to it, where the clock went back."""
        return abs(time_ns - self.seen_ns) * 1e-9
