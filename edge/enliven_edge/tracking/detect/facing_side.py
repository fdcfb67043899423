"""The facing of a person: front and back look alike, so evidence is averaged over many frames.

The evidence is the network's estimate, the direction of walking, and that people bend forward.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven_edge.tracking.body_model import (
    Posture,
    ahead_in_plan,
    chest_axes,
    chest_axes_about,
    leaning_back,
)
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, likely_to_face
from enliven_edge.tracking.estimator import facing_in_plan

_MEMORY = 15.0
"""Frames over which the evidence is averaged: half a second, longer than the network errs in one posture."""
_FIRST_VERDICT = 12
"""Frames of evidence before the first verdict: fewer say little of the mean."""
_SETTLED = 1.0
"""Log probability by which a facing must beat its opposite to be settled."""
_WRONG = -2.6
"""Log probability against its opposite below which a facing is wrong: far below 0, as no person may be turned
about without strong evidence."""
_WRONG_ALL_THE_SAME = -3.5
"""The same for a facing that was settled before, which needs more evidence yet."""
_STROLL = 0.45
"""Metres a second from which walking tells the facing: slower, people also step sideways and back."""
_WALK = 0.9
"""Metres a second from which walking says all it can: a slow walk ahead."""
_FORWARD = 4.5
"""Log probability of facing the way of a walk: more than makes a facing wrong, so that a walk decides."""
_UPRIGHT = 15.0
"""Log probability against leaning backward, times the sine: people bend forward, not backward."""


class Facing:
    """Decides over many frames whether a posture faces the wrong way."""

    def __init__(self) -> None:
        self._advantage = 0.0
        self._frames = 0
        self._settled = False

    def is_wrong(self, seen: EstimateAtPoints, posture: Posture, eye: Float, velocity: Float) -> bool:
        """Whether the posture has been facing the wrong way for a while.

        Args:
            eye: (3,) the sensor, world frame.
            velocity: (3,) metres a second of the hip centre.
        """
        ways = seen.estimate.facing
        advantage = float(_advantage(posture.rotations, posture.position, eye, velocity, ways))
        self._frames += 1
        self._advantage += max(1.0 / _MEMORY, 1.0 / self._frames) * (advantage - self._advantage)
        if self._frames < _FIRST_VERDICT:
            return False
        self._settled = self._settled or self._advantage > _SETTLED
        wrong = self._advantage < (_WRONG_ALL_THE_SAME if self._settled else _WRONG)
        if wrong:
            self._advantage, self._frames, self._settled = 0.0, 0, False
        return wrong


def backward(posture: Posture) -> float:
    """See :func:`posture.leaning_back`."""
    return float(_backward(posture.rotations))


@njit(cache=True, nogil=True)
def _backward(rotations):  # type: ignore[no-untyped-def]
    left, up = chest_axes(rotations)
    return leaning_back(left, up)


@njit(cache=True, nogil=True)
def _advantage(rotations, place, eye, velocity, ways):  # type: ignore[no-untyped-def]
    """Returns the log probability of a posture's facing less that of its opposite, by one frame.

    Args:
        rotations: (13, 3, 3) and
        place: (3,) of the posture.
        eye, velocity: as of :meth:`Facing.is_wrong`.
        ways: (8,) log probabilities of the ways to face.
    """
    left, up = chest_axes(rotations)
    other_left, other_up = chest_axes_about(rotations)
    seen = likely_to_face(ways, facing_in_plan(left, place, eye))
    seen -= likely_to_face(ways, facing_in_plan(other_left, place, eye))
    leans = leaning_back(other_left, other_up) - leaning_back(left, up)
    return seen + _FORWARD * _walking(velocity, ahead_in_plan(left)) + _UPRIGHT * leans


@njit(cache=True, nogil=True)
def _walking(velocity, ahead):  # type: ignore[no-untyped-def]
    """Returns how plainly a person walks ahead, in [-1, 1]; -1: plainly backward.

    Args:
        velocity: (3,) metres a second.
        ahead: the unit (x, z) direction of the facing.
    """
    speed = np.sqrt(velocity[0] ** 2 + velocity[2] ** 2)
    if speed < _STROLL:
        return 0.0
    along = (velocity[0] * ahead[0] + velocity[2] * ahead[1]) / speed
    return min(1.0, (speed - _STROLL) / (_WALK - _STROLL)) * along
