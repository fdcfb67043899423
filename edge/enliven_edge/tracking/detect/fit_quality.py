"""How well a fitted posture explains its frame, how odd it is, and whether it faces the wrong way.

Front and back look alike, so evidence of the facing is averaged over many frames: the network's estimate, the
direction of walking, and that people bend forward.
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
    model,
)
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT,
    EstimateAtPoints,
    agreement,
    facing_score,
    likely_to_face,
)
from enliven_edge.tracking.estimator import facing_in_plan
from enliven_edge.tracking.fit import FitReport
from enliven_edge.tracking.frame import Observation

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


@njit(cache=True, nogil=True)
def backward(rotations):
    """See :func:`posture.leaning_back`; of (13, 3, 3) rotations."""
    left, up = chest_axes(rotations)
    return leaning_back(left, up)


@njit(cache=True, nogil=True)
def _advantage(rotations, place, eye, velocity, ways):
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
def _walking(velocity, ahead):
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


_FACING = 0.6
"""Square centimetres a point: cost of a less likely facing, for each unit of log probability."""
_BACKWARD = 12.0
"""Square centimetres a point: cost of leaning backward, times the sine: people bend forward."""
_STATURE = 2.0
"""Square centimetres a point: cost of the unlikeliest stature; less than of a posture that explains badly."""
_SPREAD = 0.15
"""Metres from the likeliest stature at which a third of that is paid: about two deviations of adults."""
_SHORTEST = 0.9
"""Metres: the least height of what is seen for it to be taken for a standing person's, a child's."""
_TALLEST = 2.1
"""Metres: the greatest height of what is seen for it to be a person's, and not raised arms."""
_ALIKE = 0.08
"""Share by which two statures may differ to be searched as one: 14 cm of 1.72 m, which a fit makes up for."""


def cost(
    report: FitReport, posture: Posture, seen: EstimateAtPoints | None, eye: Float, height: float
) -> float:
    """Returns the whole cost of a fitted posture, square centimetres a point; comparable within one frame."""
    return report.energy + oddness(seen, posture, eye, height)


def oddness(seen: EstimateAtPoints | None, posture: Posture, eye: Float, height: float) -> float:
    """Returns the cost of a posture without depth, square centimetres a point.

    It adds up points that the network takes for other parts, a facing that it does not see, leaning backward,
    and a stature far from the likeliest.
    """
    unlike = ((model.height_of(posture.lengths) - height) / _SPREAD) ** 2
    stature = _STATURE * unlike / (unlike + 2.0) + _BACKWARD * float(backward(posture.rotations))
    if seen is None:
        return stature
    facing = facing_score(seen, posture, eye)
    return stature + DISAGREEMENT * (1.0 - agreement(seen, posture)) - _FACING * facing


def quality(report: FitReport) -> float:
    """Returns the share of points explained less the share of the model seen through, up to 1."""
    return report.explained - report.seen_through


def likely_builds(observation: Observation, height: float) -> list[Float]:
    """Returns (12,) lengths of one or two builds: of the likeliest height, and of the height that is seen.

    A lower height may be a child's, or an adult's who crouches; a higher one a tall person's, or raised arms.
    """
    seen = float(observation.crown[1]) + 0.01
    if observation.cut or not _SHORTEST < seen < _TALLEST:
        return [model.lengths_for_height(height)]
    if abs(seen / height - 1.0) < _ALIKE:
        return [model.lengths_for_height(seen)]
    return [model.lengths_for_height(height), model.lengths_for_height(seen)]
