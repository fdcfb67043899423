"""Left and right: a sensor that sees a back may exchange the sides. Time and a majority vote decide."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from enliven.arrays import Bool, Float
from enliven.person import MIRROR, Body, J, Joint
from enliven.rotation import multiply
from enliven_edge.fusion.live.blending import side_costs

OTHER_SIDE = np.array(MIRROR)
"""(20,) the mirrored joint of each joint, such as the right hand for the left hand. Joints of the trunk are
mapped to themselves.
"""
MIDLINE_JOINTS = np.array([(j, MIRROR[j]) for j in range(J) if j <= MIRROR[j]])
"""(12, 2) pairs of joints with a midpoint that stays in place if left and right are exchanged."""
_HALF_TURN = np.array([0.0, 0.0, 1.0, 0.0])
"""(4,) quaternion of a rotation by 180 degrees about a bone's length."""


def midline_points(joints: Float) -> Float:
    """Returns the (..., 12, 3) points of a body that do not move if left and right are exchanged."""
    return np.asarray(0.5 * (joints[..., MIDLINE_JOINTS[:, 0], :] + joints[..., MIDLINE_JOINTS[:, 1], :]))


def midline_weights(weights: Float) -> Float:
    """Returns (..., 12) weights of the midpoints from (..., 20) weights of joints.

    The weight of a midpoint is the smaller one of its two joints.
    """
    return np.minimum(weights[..., MIDLINE_JOINTS[:, 0]], weights[..., MIDLINE_JOINTS[:, 1]])


def swap_sides(body: Body) -> Body:
    """Returns the body with left and right exchanged. Applied twice it returns the same body.

    The positions are assigned to the joints of the other side. Every bone is also rotated by half a turn
    about its length, because the person was taken to face the other way.
    """
    orientations = body.orientations
    return dataclasses.replace(
        body,
        joints=body.joints[OTHER_SIDE],
        confidence=body.confidence[OTHER_SIDE],
        orientations=None if orientations is None else multiply(orientations, _HALF_TURN)[OTHER_SIDE],
        contacts=None if body.contacts is None else body.contacts[::-1].copy(),
    )


_MIN_SIDE_SWAP_GAIN_M = 0.06
"""Minimum improvement of the fit in metres per joint for exchanged sides to be accepted."""
_MIN_WALK_SPEED = 0.4
"""Minimum speed of the hips in metres per second at which walking shows the facing direction."""
_SETTLED_AFTER_S = 3.0
"""Seconds after which the left and right side of a new person count as known."""


class SideAssignment:
    """The sensors that currently exchange left and right of one person.

    Args:
        sensors: number of sensors.
        turn_over: seconds for which a majority must vote before the sides are exchanged for all sensors.
    """

    def __init__(self, sensors: int, turn_over: float) -> None:
        self._is_swapped: Bool = np.zeros(sensors, bool)
        self._turn_over = turn_over
        self._doubt, self._watched = 0.0, 0.0

    def correct_sides(self, bodies: Mapping[int, Body]) -> dict[int, Body]:
        """Returns the bodies with the decided assignment of left and right."""
        return {s: self._restore_names(s, body) for s, body in bodies.items()}

    def compare(self, bodies: Mapping[int, Body], expected: Float, spoke: Bool, known: bool) -> None:
        """Decides for every sensor whether it has exchanged left and right, by comparison with the expected
        joints.

        If two sensors contradict each other after that, the one with the smaller margin is exchanged.

        Args:
            bodies: by sensor, its body of this person.
            expected: (20, 3) joints in metres. For a new person, the joints of any of the sensors.
            spoke: (S,) whether a sensor saw this person in the last update. If so, its assignment changes
                only with a clear margin.
            known: whether this person was seen before.
        """
        margins = {}
        for sensor, body in bodies.items():
            margin = self._swap_cost_margin(sensor, body, expected)
            if margin < (-_MIN_SIDE_SWAP_GAIN_M if spoke[sensor] else 0.0):
                self._is_swapped[sensor] ^= True
                margin = -margin
            margins[sensor] = margin
        if len(bodies) > 1 and known:
            smallest = min(margins, key=lambda s: margins[s])
            others = [self._restore_names(s, body).joints for s, body in bodies.items() if s != smallest]
            if (
                self._swap_cost_margin(smallest, bodies[smallest], np.mean(others, axis=0))
                < -_MIN_SIDE_SWAP_GAIN_M
            ):
                self._is_swapped[smallest] ^= True

    def vote(self, weights: Mapping[int, float], backward: float, seconds: float, known: bool) -> bool:
        """Returns True if the sides are exchanged for all sensors, after a long enough majority vote.

        If sensors disagree, the walking direction decides, because people mostly walk forward. For a new
        person nothing is decided yet, because first observations are less reliable.

        Args:
            weights: by sensor, the weight of its vote.
            backward: 1 if the person walks backward with the present sides, -1 if it walks forward, 0 if it
                stands.
            seconds: time since the last vote.
            known: whether this person was seen before.
        """
        total = sum(weights.values()) or 1.0
        against = sum(w for s, w in weights.items() if self._is_swapped[s]) / total
        vote = 2.0 * against - 1.0 + (backward if 0.0 < against < 1.0 else 0.0)
        self._doubt = float(np.clip(self._doubt + vote * seconds, 0.0, 10.0))
        self._watched += seconds
        is_settled = min(max(self._watched / _SETTLED_AFTER_S, 0.1), 1.0)
        majority = self._doubt > is_settled * self._turn_over or (not known and against > 0.5)
        if majority:
            self._is_swapped, self._doubt = ~self._is_swapped, 0.0
        return majority

    def _swap_cost_margin(self, sensor: int, body: Body, reference: Float) -> float:
        """Returns how much better the present sides fit than exchanged ones, in metres per joint."""
        kept_cost, swapped_cost = side_costs(body.joints, body.confidence, reference, OTHER_SIDE)
        return float(kept_cost - swapped_cost if self._is_swapped[sensor] else swapped_cost - kept_cost)

    def _restore_names(self, sensor: int, body: Body) -> Body:
        """Returns a sensor's body with the sides as the sensor named them."""
        return swap_sides(body) if self._is_swapped[sensor] else body


def walking_direction_sign(joints: Float, velocity: Float) -> float:
    """Returns 1 if a person walks backward with the present sides, -1 if it walks forward, 0 if it stands.

    Args:
        joints, velocity: (20, 3) metres and (20, 3) metres per second.
    """
    left = joints[[Joint.SHOULDER_LEFT, Joint.HIP_LEFT]].mean(0)
    left_axis = left - joints[[Joint.SHOULDER_RIGHT, Joint.HIP_RIGHT]].mean(0)
    hips = velocity[Joint.HIP_CENTER]
    forward = np.array([-left_axis[2], 0.0, left_axis[0]])
    if float(np.linalg.norm(forward)) < 0.05 or float(np.hypot(hips[0], hips[2])) < _MIN_WALK_SPEED:
        return 0.0
    return float(-np.sign(forward @ hips))
