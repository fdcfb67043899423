"""The quality of a fitted posture: its explanation of the frame, its plausibility, and its facing.

Front and back look alike. So evidence of the facing is averaged over many frames: the network's estimate, the
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

_EVIDENCE_FRAMES = 15.0
"""Number of frames over which the evidence is averaged: half a second. The network's errors in one posture
last for a shorter time."""
_MIN_EVIDENCE_FRAMES = 12
"""Minimum number of frames of evidence before the first decision. With fewer the mean is unreliable."""
_SETTLED_LEAD = 1.0
"""Minimum lead of a facing over its opposite to be settled, as a log probability."""
_WRONG_FACING_LOG = -2.6
"""Log probability relative to its opposite below which a facing is wrong. It is far below 0, because a person
must not be flipped without strong evidence."""
_WRONG_SETTLED_LOG = -3.5
"""The same limit for a facing that was settled before, which needs even more evidence."""
_MIN_WALK_SPEED = 0.45
"""Minimum walking speed in metres per second that indicates the facing. At lower speeds people also step
sideways and back."""
_FULL_WALK_SPEED = 0.9
"""Walking speed in metres per second with full weight: a slow walk ahead."""
_WALK_LOG = 4.5
"""Log probability of facing the direction of a walk. It exceeds the limit of a wrong facing, so that a walk
decides."""
_LEAN_LOG = 15.0
"""Log probability against leaning backward, per unit of its sine. People bend forward, not backward."""


class Facing:
    """Decides over many frames whether a posture faces the wrong way."""

    def __init__(self) -> None:
        self._advantage = 0.0
        self._frames = 0
        self._settled = False

    def is_wrong(self, seen: EstimateAtPoints, posture: Posture, eye: Float, velocity: Float) -> bool:
        """Returns True if the posture has been facing the wrong way for a while.

        Args:
            seen: the network's estimate of the frame.
            posture: the fitted posture.
            eye: (3,) the sensor, world frame.
            velocity: (3,) metres per second of the hip centre.
        """
        ways = seen.estimate.facing
        advantage = float(_advantage(posture.rotations, posture.position, eye, velocity, ways))
        self._frames += 1
        self._advantage += max(1.0 / _EVIDENCE_FRAMES, 1.0 / self._frames) * (advantage - self._advantage)
        if self._frames < _MIN_EVIDENCE_FRAMES:
            return False
        self._settled = self._settled or self._advantage > _SETTLED_LEAD
        wrong = self._advantage < (_WRONG_SETTLED_LOG if self._settled else _WRONG_FACING_LOG)
        if wrong:
            self._advantage, self._frames, self._settled = 0.0, 0, False
        return wrong


@njit(cache=True, nogil=True)
def backward(rotations):
    """Computes :func:`posture.leaning_back` of (13, 3, 3) rotations."""
    left, up = chest_axes(rotations)
    return leaning_back(left, up)


@njit(cache=True, nogil=True)
def _advantage(rotations, place, eye, velocity, ways):
    """Returns the log probability of a posture's facing minus that of its opposite, in one frame.

    Args:
        rotations: (13, 3, 3) of the posture.
        place: (3,) position of the posture.
        eye, velocity: as in :meth:`Facing.is_wrong`.
        ways: (8,) log probabilities of the facing directions.
    """
    left, up = chest_axes(rotations)
    other_left, other_up = chest_axes_about(rotations)
    seen = likely_to_face(ways, facing_in_plan(left, place, eye))
    seen -= likely_to_face(ways, facing_in_plan(other_left, place, eye))
    leans = leaning_back(other_left, other_up) - leaning_back(left, up)
    return seen + _WALK_LOG * _walking(velocity, ahead_in_plan(left)) + _LEAN_LOG * leans


@njit(cache=True, nogil=True)
def _walking(velocity, ahead):
    """Returns how clearly a person walks ahead, in [-1, 1]. -1: clearly backward.

    Args:
        velocity: (3,) metres per second.
        ahead: the unit (x, z) direction of the facing.
    """
    speed = np.sqrt(velocity[0] ** 2 + velocity[2] ** 2)
    if speed < _MIN_WALK_SPEED:
        return 0.0
    along = (velocity[0] * ahead[0] + velocity[2] * ahead[1]) / speed
    return min(1.0, (speed - _MIN_WALK_SPEED) / (_FULL_WALK_SPEED - _MIN_WALK_SPEED)) * along


_FACING_COST = 0.6
"""Cost of a less likely facing in square centimetres per point, per unit of log probability."""
_LEAN_COST = 12.0
"""Cost of leaning backward in square centimetres per point, per unit of its sine. People bend forward."""
_STATURE_COST = 2.0
"""Cost of the unlikeliest stature in square centimetres per point. It is less than that of a posture that
explains the frame badly."""
_STATURE_SPREAD_M = 0.15
"""Metres from the likeliest stature at which a third of that cost applies: about two standard deviations of
adults."""
_MIN_STATURE_M = 0.9
"""Minimum visible height in metres to be taken for the height of a standing person: a child."""
_MAX_STATURE_M = 2.1
"""Maximum visible height in metres to be a person's height. A higher one includes raised arms."""
_SAME_STATURE_RATIO = 0.08
"""Maximum relative difference of two statures that are searched as one: 14 cm of 1.72 m, which a fit can
compensate."""


def cost(
    report: FitReport, posture: Posture, seen: EstimateAtPoints | None, eye: Float, height: float
) -> float:
    """Returns the total cost of a fitted posture, square centimetres per point.

    Costs are comparable within one frame.
    """
    return report.energy + oddness(seen, posture, eye, height)


def oddness(seen: EstimateAtPoints | None, posture: Posture, eye: Float, height: float) -> float:
    """Returns the cost of a posture apart from depth, square centimetres per point.

    It is the sum of four costs: points that the network assigns to other parts, a facing that the network
    does not see, leaning backward, and a stature far from the likeliest.
    """
    unlike = ((model.height_of(posture.lengths) - height) / _STATURE_SPREAD_M) ** 2
    stature = _STATURE_COST * unlike / (unlike + 2.0) + _LEAN_COST * float(backward(posture.rotations))
    if seen is None:
        return stature
    facing = facing_score(seen, posture, eye)
    return stature + DISAGREEMENT * (1.0 - agreement(seen, posture)) - _FACING_COST * facing


def quality(report: FitReport) -> float:
    """Returns the fraction of points explained minus the fraction of the model seen through, up to 1."""
    return report.explained - report.seen_through


def likely_builds(observation: Observation, height: float) -> list[Float]:
    """Returns (12,) lengths of one or two builds: of the likeliest height, and of the visible height.

    A lower visible height may be that of a child, or of an adult that crouches. A higher one may be that of a
    tall person, or of raised arms.
    """
    seen = float(observation.crown[1]) + 0.01
    if observation.cut or not _MIN_STATURE_M < seen < _MAX_STATURE_M:
        return [model.lengths_for_height(height)]
    if abs(seen / height - 1.0) < _SAME_STATURE_RATIO:
        return [model.lengths_for_height(seen)]
    return [model.lengths_for_height(height), model.lengths_for_height(seen)]
