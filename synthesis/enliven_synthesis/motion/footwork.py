"""Computes poses of the feet, and the pelvis path above them, from a list of steps."""

from __future__ import annotations

from enliven_synthesis.body.posture import FootPose
from enliven_synthesis.motion.tracks import Step, smooth_pulse

Stance = tuple[tuple[float, float, float], tuple[float, float, float]]
"""(x, z, yaw) of the left foot and of the right foot, in metres and radians."""
SHIFT_S = 0.24
"""Duration in seconds of the weight shift to the other foot before a step, and of the shift back after it."""
PUSH_S = 0.16
"""Seconds in which the heel rises before the ball leaves the floor."""


class Footwork:
    """The poses of both feet over time.

    Args:
        stance: (x, z, yaw) of the left foot and of the right foot at the start.
        steps: the steps, ordered by start time.
        carry: movement of the pelvis over the standing foot: 0 is not at all, 1 is fully.
    """

    def __init__(
        self,
        stance: Stance,
        steps: list[Step],
        carry: float = 0.72,
    ) -> None:
        self._stance, self._steps, self._carry = stance, steps, carry

    def foot(self, side: int, time: float) -> FootPose:
        """Returns the pose of the left (0) or right (1) foot at ``time`` seconds."""
        x, z, yaw = self._stance[side]
        lift, pitch = 0.0, 0.0
        for step in self._steps:
            if step.foot != side:
                continue
            dx, dz = step.offset(time)
            x, z = x + dx, z + dz
            lift += step.height(time)
            pitch -= step.toe * smooth_pulse(time, step.start, (step.start + step.stop) / 2, PUSH_S)
        return FootPose(x, z, lift, yaw, pitch)

    def pelvis(self, time: float) -> tuple[float, float]:
        """Returns (x, z) of the pelvis in metres: between the feet, and closer to the standing foot during a
        step.
        """
        left, right = self._foot_position(0, time), self._foot_position(1, time)
        middle = ((left[0] + right[0]) / 2, (left[1] + right[1]) / 2)
        toward = [smooth_pulse(time, s.start, s.stop, SHIFT_S) for s in self._steps if not s.both]
        standing = [(left, right)[1 - s.foot] for s in self._steps if not s.both]
        total = max(1.0, sum(toward))
        x, z = middle
        for weight, foot in zip(toward, standing, strict=True):
            x += self._carry * weight / total * (foot[0] - middle[0])
            z += 0.5 * self._carry * weight / total * (foot[1] - middle[1])
        return x, z

    def _foot_position(self, side: int, time: float) -> tuple[float, float]:
        """Returns (x, z) of a foot in metres, without the sideways arcs of its steps."""
        x, z, _ = self._stance[side]
        own_steps = [(s.progress(time), s) for s in self._steps if s.foot == side]
        return x + sum(p * s.dx for p, s in own_steps), z + sum(p * s.dz for p, s in own_steps)

    def weight_balance(self, time: float) -> float:
        """Returns the weight distribution: -1 is all on the right foot, +1 all on the left foot, 0 on both
        feet equally.
        """
        signed = [
            smooth_pulse(time, s.start, s.stop, SHIFT_S) * (2 * s.foot - 1) for s in self._steps if not s.both
        ]
        return max(-1.0, min(1.0, sum(signed)))

    def compute_hop_height(self, time: float) -> float:
        """Returns the body's height in a hop in metres."""
        return max((s.height(time) for s in self._steps if s.both), default=0.0)

    def is_planted(self, side: int, time: float) -> bool:
        """Returns True if the ball of a foot is on the floor."""
        return all(not s.start < time < s.stop for s in self._steps if s.foot == side)
