"""Left and right: a sensor that sees a back may name them the wrong way round; time and majority decide."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from enliven.arrays import Bool, Float
from enliven.person import MIRROR, Body, J, Joint
from enliven.rotation import multiply
from enliven_edge.fusion.live.blending import side_costs

OTHER_SIDE = np.array(MIRROR)
"""(20,) the joint of the other side; the trunk's joints are their own."""
MIDDLES = np.array([(j, MIRROR[j]) for j in range(J) if j <= MIRROR[j]])
"""(12, 2) joints with a midpoint that does not depend on the naming of sides."""
_ABOUT_FACE = np.array([0.0, 0.0, 1.0, 0.0])
"""(4,) half a turn about a bone's length."""


def middles(joints: Float) -> Float:
    """Returns (..., 12, 3) the points of a body that an exchange of sides leaves in place."""
    return np.asarray(0.5 * (joints[..., MIDDLES[:, 0], :] + joints[..., MIDDLES[:, 1], :]))


def middle_weights(weights: Float) -> Float:
    """Returns (..., 12) of (..., 20): the smaller of the two joints' weights."""
    return np.minimum(weights[..., MIDDLES[:, 0]], weights[..., MIDDLES[:, 1]])


def exchanged(body: Body) -> Body:
    """Returns the body with left and right exchanged; twice is the body itself.

    Positions change their names only. Every bone is also turned half about its length, so that the front of a
    person who was taken for facing the other way is where it truly is.
    """
    turns = body.orientations
    return dataclasses.replace(
        body,
        joints=body.joints[OTHER_SIDE],
        confidence=body.confidence[OTHER_SIDE],
        orientations=None if turns is None else multiply(turns, _ABOUT_FACE)[OTHER_SIDE],
        contacts=None if body.contacts is None else body.contacts[::-1].copy(),
    )


_CLEARLY = 0.06
"""Metres a joint by which exchanged sides must fit better to be taken."""
_WALKING = 0.4
"""Metres a second of the hips above which walking shows the direction of facing."""
_SETTLED = 3.0
"""Seconds after which the sides of a new person count as known."""


class SideKeeper:
    """Keeps for one person which of the sensors name the sides the wrong way round at present.

    Args:
        sensors: how many there are.
        turn_over: seconds for which most must say so until the sides are exchanged for all.
    """

    def __init__(self, sensors: int, turn_over: float) -> None:
        self._crossed: Bool = np.zeros(sensors, bool)
        self._turn_over = turn_over
        self._doubt, self._watched = 0.0, 0.0

    def put_right(self, bodies: Mapping[int, Body]) -> dict[int, Body]:
        """Returns the bodies with the sides that were decided on."""
        return {s: self._as_named(s, body) for s, body in bodies.items()}

    def compare(self, bodies: Mapping[int, Body], expected: Float, spoke: Bool, known: bool) -> None:
        """Decides for every sensor whether it has exchanged the sides, by the expected joints.

        Where two sensors contradict each other after that, the one with the smaller margin is exchanged.

        Args:
            expected: (20, 3); of a new person, the joints of any of the sensors.
            spoke: (S,) whether a sensor saw this person a moment ago; then the margin must be clear.
            known: whether this person was ever seen before.
        """
        margins = {}
        for sensor, body in bodies.items():
            margin = self._margin(sensor, body, expected)
            if margin < (-_CLEARLY if spoke[sensor] else 0.0):
                self._crossed[sensor] ^= True
                margin = -margin
            margins[sensor] = margin
        if len(bodies) > 1 and known:
            least = min(margins, key=lambda s: margins[s])
            others = [self._as_named(s, body).joints for s, body in bodies.items() if s != least]
            if self._margin(least, bodies[least], np.mean(others, axis=0)) < -_CLEARLY:
                self._crossed[least] ^= True

    def vote(self, weights: Mapping[int, float], backward: float, seconds: float, known: bool) -> bool:
        """Returns whether the sides are exchanged for all sensors: most have said so for long enough.

        Where sensors disagree, the direction of walking decides: people walk forward most of the time. A new
        person is not decided yet: a first look errs more often than a long one.

        Args:
            weights: by sensor, the weight of its vote.
            backward: 1 for a person who walks backward as the sides are named, -1 forward, 0 standing.
        """
        total = sum(weights.values()) or 1.0
        crossed = sum(w for s, w in weights.items() if self._crossed[s]) / total
        vote = 2.0 * crossed - 1.0 + (backward if 0.0 < crossed < 1.0 else 0.0)
        self._doubt = float(np.clip(self._doubt + vote * seconds, 0.0, 10.0))
        self._watched += seconds
        settled = min(max(self._watched / _SETTLED, 0.1), 1.0)
        over = self._doubt > settled * self._turn_over or (not known and crossed > 0.5)
        if over:
            self._crossed, self._doubt = ~self._crossed, 0.0
        return over

    def _margin(self, sensor: int, body: Body, reference: Float) -> float:
        """Returns metres a joint by which the sides as named now fit better than exchanged."""
        plain, crossed = side_costs(body.joints, body.confidence, reference, OTHER_SIDE)
        return float(plain - crossed if self._crossed[sensor] else crossed - plain)

    def _as_named(self, sensor: int, body: Body) -> Body:
        return exchanged(body) if self._crossed[sensor] else body


def walks_backward(joints: Float, velocity: Float) -> float:
    """Returns 1 for walking backward as the sides are named, -1 forward, 0 standing.

    Args:
        joints: (20, 3) metres; velocity: (20, 3) metres a second.
    """
    left = joints[[Joint.SHOULDER_LEFT, Joint.HIP_LEFT]].mean(0)
    across = left - joints[[Joint.SHOULDER_RIGHT, Joint.HIP_RIGHT]].mean(0)
    hips = velocity[Joint.HIP_CENTER]
    forward = np.array([-across[2], 0.0, across[0]])
    if float(np.linalg.norm(forward)) < 0.05 or float(np.hypot(hips[0], hips[2])) < _WALKING:
        return 0.0
    return float(-np.sign(forward @ hips))
