"""A walk about the room, like the walk that calibrates several sensors relative to each other.

The path is a closed curve that crosses itself. It covers the floor in both directions and shows the walker
from every side. The arms swing, and are raised now and then.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven_synthesis.body.posture import ArmPose, FootPose, PerformerPosture
from enliven_synthesis.motion.dance import START_Z_M, Choreography
from enliven_synthesis.motion.tracks import ease

_STANCE_FRACTION = 0.56
"""Fraction of a stride during which a foot stands. Over one half means walking, not running."""
_FOOT_OFFSET_M = 0.09
"""Sideways distance in metres of a foot from the path: about half the width of the hips."""


class WalkPath:
    """A walk along the Lissajous curve x = a sin(m u), z = b sin(n u), once round in ``duration`` seconds.

    Args:
        breadth, depth: size of the path in metres, between the outermost points.
        waves: (m, n). (1, 2) is a figure of eight, (1, 1) with a phase of a quarter turn is an ellipse, and
            (1, 0) is a line.
        phase: phase of z relative to x in radians.
        pace: duration of a step in seconds.
    """

    def __init__(
        self,
        duration: float = 16.0,
        breadth: float = 1.6,
        depth: float = 1.2,
        waves: tuple[int, int] = (1, 2),
        phase: float = 0.0,
        pace: float = 0.55,
    ) -> None:
        self.duration, self._waves, self._phase = duration, waves, phase
        self._size = np.array([breadth, depth]) / 2
        self._pace = duration / (2 * max(1, round(duration / pace / 2)))

    def find_position(self, time: float) -> Float:
        """Returns (2,) x and z on the path in metres, relative to its middle."""
        u = 2 * math.pi * time / self.duration
        m, n = self._waves
        return np.asarray(self._size * [math.sin(m * u), math.sin(n * u + self._phase)])

    def yaw(self, time: float) -> float:
        """Returns the walking direction in radians about +Y. 0 is +Z."""
        ahead = self.find_position(time + 0.12) - self.find_position(time - 0.12)
        return math.atan2(ahead[0], ahead[1])

    def posture(self, time: float) -> PerformerPosture:
        """Returns the walker's posture at a time in seconds."""
        x, z = self.find_position(time)
        yaw = self.yaw(time)
        left, right = self._foot(0, time), self._foot(1, time)
        forward = np.array([math.sin(yaw), math.cos(yaw)])
        stride = float(np.array([left.x - right.x, left.z - right.z]) @ forward)
        raised = 0.5 - 0.5 * math.cos(2 * math.pi * 3 * time / self.duration)
        return PerformerPosture(
            left, right, _arm(-0.8 * stride, 0.0), _arm(0.8 * stride, raised), x, START_Z_M + z,
            yaw=yaw, pitch=0.03, spine_yaw=0.4 * stride, spine_pitch=0.04, head_yaw=0.2 * raised,
        )  # fmt: skip

    def _foot(self, side: int, time: float) -> FootPose:
        """Returns a foot that alternately stands for one step and swings for one step. ``side`` 0 is the
        left.
        """
        stride = 2 * self._pace
        count, share = divmod(time / stride + 0.5 * side, 1.0)
        middle = (count - 0.5 * side) * stride
        start, stop = self._footprint(side, middle), self._footprint(side, middle + stride)
        flown = ease((share - _STANCE_FRACTION) / (1.0 - _STANCE_FRACTION))
        bump = 4.0 * flown * (1.0 - flown)
        (x, z), yaw = (
            start[0] + flown * (stop[0] - start[0]),
            start[1] + flown * _signed_rotation(start[1], stop[1]),
        )
        return FootPose(float(x), START_Z_M + float(z), 0.07 * bump, yaw, -0.25 * bump)

    def is_standing(self, side: int, time: float) -> bool:
        """Returns True if the left (0) or right (1) foot stands."""
        return (time / (2 * self._pace) + 0.5 * side) % 1.0 < _STANCE_FRACTION

    def _footprint(self, side: int, time: float) -> tuple[Float, float]:
        """Returns the position (x, z) in metres and the yaw in radians of a footprint.

        It is next to the body's position halfway through the foot's stance.
        """
        landing_time = time + 0.25 * 2 * self._pace
        yaw = self.yaw(landing_time)
        sideways = np.array([math.cos(yaw), -math.sin(yaw)]) * (
            _FOOT_OFFSET_M if side == 0 else -_FOOT_OFFSET_M
        )
        return self.find_position(landing_time) + sideways, yaw


def _signed_rotation(start: float, stop: float) -> float:
    """Returns the shorter signed rotation from one direction to another in radians."""
    return (stop - start + math.pi) % (2 * math.pi) - math.pi


def _arm(swing: float, raised: float) -> ArmPose:
    return ArmPose(
        flex=0.03 + swing * (1 - raised) + 1.2 * raised,
        abduct=0.14 + 0.3 * raised,
        twist=0.2,
        elbow=0.3 + 0.6 * max(swing, 0.0) + 0.8 * raised,
        wrist=0.1,
    )


def wander(duration: float = 16.0, **path: float) -> Choreography:
    """Returns the choreography of walking along a path; see :class:`WalkPath` for its arguments."""
    walked = WalkPath(duration, **path)  # type: ignore[arg-type]
    return Choreography("wander", duration, walked.posture, walked.is_standing)
