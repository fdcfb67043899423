"""The quality of a fitted posture: how well it explains the frame, its plausibility, and its facing.

A person's front and back look alike in depth. So three signs of the facing are averaged over many frames: the
network's estimate, the direction of walking, and the lean of the trunk, because people bend forward.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import (
    Posture,
    backward_lean,
    chest_axes,
    chest_axes_about,
    facing_direction,
)
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT_COST,
    EstimateAtPoints,
    compute_facing_score,
    facing_log_probability,
    network_agreement,
)
from enliven_edge.tracking.estimator.labels import facing_in_plan
from enliven_edge.tracking.fit.fit import FitReport
from enliven_edge.tracking.frame.observation import Observation

_EVIDENCE_FRAMES = 15.0
"""Number of frames over which the evidence is averaged: half a second. Wrong estimates of the network in one
posture do not last that long."""
_MIN_EVIDENCE_FRAMES = 12
"""Minimum number of frames of evidence before the first decision. With fewer the mean is unreliable."""
_SETTLED_LEAD = 1.0
"""Minimum log probability of a facing relative to its opposite for the facing to count as settled."""
_WRONG_FACING_LOG = -2.6
"""If a facing's log probability relative to its opposite is below this value, the facing is wrong. It is far
below 0, because a person must not be flipped without strong evidence."""
_WRONG_SETTLED_LOG = -3.5
"""Like ``_WRONG_FACING_LOG``, for a settled facing. A flip then needs even more evidence."""
_MIN_WALK_SPEED = 0.45
"""Minimum walking speed in metres per second that indicates the facing. At lower speeds people also step
sideways and back."""
_FULL_WALK_SPEED = 0.9
"""Minimum walking speed in m/s for full weight of the walking direction: a slow walk."""
_WALK_LOG = 4.5
"""Log probability added for facing the walking direction. It exceeds the limits above, so that walking
decides."""
_LEAN_LOG = 15.0
"""Log probability against leaning backward, per unit of its sine. People bend forward, not backward."""


class Facing:
    """Decides over many frames whether a posture faces the wrong way."""

    def __init__(self) -> None:
        self._advantage = 0.0
        self._frames = 0
        self._settled = False

    def is_wrong(
        self, network_output: EstimateAtPoints, posture: Posture, eye: Float, velocity: Float
    ) -> bool:
        """Returns True if the averaged evidence shows that the posture faces the wrong way.

        Args:
            network_output: the network's estimate of the frame.
            posture: the fitted posture.
            eye: (3,) the sensor, world frame.
            velocity: (3,) metres per second of the hip centre.
        """
        facing_logs = network_output.estimate.facing
        advantage = float(facing_advantage(posture.rotations, posture.position, eye, velocity, facing_logs))
        self._frames += 1
        self._advantage += max(1.0 / _EVIDENCE_FRAMES, 1.0 / self._frames) * (advantage - self._advantage)
        if self._frames < _MIN_EVIDENCE_FRAMES:
            return False
        self._settled = self._settled or self._advantage > _SETTLED_LEAD
        faces_wrong_way = self._advantage < (_WRONG_SETTLED_LOG if self._settled else _WRONG_FACING_LOG)
        if faces_wrong_way:
            self._advantage, self._frames, self._settled = 0.0, 0, False
        return faces_wrong_way


@njit(cache=True, nogil=True)
def leaning_backward(rotations):
    """Computes :func:`posture.backward_lean` of (13, 3, 3) rotations."""
    left, up = chest_axes(rotations)
    return backward_lean(left, up)


@njit(cache=True, nogil=True)
def facing_advantage(rotations, place, eye, velocity, ways):
    """Returns the log probability of a posture's facing minus that of its opposite, in one frame.

    Args:
        rotations: (13, 3, 3) of the posture.
        place: (3,) position of the posture.
        eye, velocity: as in :meth:`Facing.is_wrong`.
        ways: (8,) log probabilities of the facing directions.
    """
    left, up = chest_axes(rotations)
    other_left, other_up = chest_axes_about(rotations)
    seen = facing_log_probability(ways, facing_in_plan(left, place, eye))
    seen -= facing_log_probability(ways, facing_in_plan(other_left, place, eye))
    leans = backward_lean(other_left, other_up) - backward_lean(left, up)
    return seen + _WALK_LOG * _walk_alignment(velocity, facing_direction(left)) + _LEAN_LOG * leans


@njit(cache=True, nogil=True)
def _walk_alignment(velocity, ahead):
    """Returns how clearly a person walks forward, from 1 (clearly forward) to -1 (clearly backward).

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
"""Maximum cost of an unlikely stature in square centimetres per point. It is lower than the cost of a posture
that explains the frame badly."""
_STATURE_SPREAD_M = 0.15
"""Difference in metres from the likeliest stature at which a third of the maximum cost applies: about two
standard deviations of adults."""
_MIN_STATURE_M = 0.9
"""Minimum visible height in metres that may be the height of a standing person: a child."""
_MAX_STATURE_M = 2.1
"""Maximum visible height in metres that may be the height of a standing person. A larger one includes raised
arms."""
_SAME_STATURE_RATIO = 0.08
"""Two statures that differ by less than this fraction are searched as one: 14 cm of 1.72 m, which a fit can
compensate."""


def implausibility_cost(
    network_output: EstimateAtPoints | None, posture: Posture, eye: Float, height: float
) -> float:
    """Returns the implausibility of a posture, which does not depend on depth, in square centimetres per
    point.

    It is the sum of four costs: points that the network assigns to other parts, a facing unlike the
    network's, leaning backward, and a stature far from the likeliest.
    """
    stature_deviation = ((model.body_height_from_lengths(posture.lengths) - height) / _STATURE_SPREAD_M) ** 2
    stature = _STATURE_COST * stature_deviation / (stature_deviation + 2.0) + _LEAN_COST * float(
        leaning_backward(posture.rotations)
    )
    if network_output is None:
        return stature
    facing = compute_facing_score(network_output, posture, eye)
    return (
        stature
        + DISAGREEMENT_COST * (1.0 - network_agreement(network_output, posture))
        - _FACING_COST * facing
    )


def fit_quality(report: FitReport) -> float:
    """Returns the fraction of explained points minus the fraction of the model that is in free space; at most
    1.
    """
    return report.explained - report.seen_through


def likely_builds(observation: Observation, height: float) -> list[Float]:
    """Returns bone lengths (12,) of one or two builds: for the likeliest height, and for the visible height.

    A smaller visible height may come from a child, or from an adult that crouches. A greater visible height
    may come from a tall person, or from raised arms.
    """
    visible_height = float(observation.crown[1]) + 0.01
    if observation.cut or not _MIN_STATURE_M < visible_height < _MAX_STATURE_M:
        return [model.lengths_for_height(height)]
    if abs(visible_height / height - 1.0) < _SAME_STATURE_RATIO:
        return [model.lengths_for_height(visible_height)]
    return [model.lengths_for_height(height), model.lengths_for_height(visible_height)]
