"""Second thoughts: an arm that explains nothing of the picture is tried elsewhere, one proposal a frame.

Nearest-surface fitting cannot bring back an arm that has been caught by another limb, because every pixel of
the real arm is explained by something else nearby. A proposal that starts elsewhere can.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking import model
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.observation import Observation
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.ranges import mirrored, standing

_POSES = (
    standing(arm_raise=0.15, arm_forward=0.1, elbow=1.5),
    standing(arm_raise=0.2, elbow=0.15),
    standing(arm_raise=1.4, elbow=0.1),
    standing(arm_raise=0.2, arm_forward=1.5, elbow=0.2),
    standing(arm_raise=2.5, elbow=0.4),
)
"""Forearm forward, hanging, out, forward, overhead. Before these come the arm as it was when last sure,
and the other arm's mirror image."""
_ARMS = ((model.UPPER_ARM_L, model.FOREARM_L), (model.UPPER_ARM_R, model.FOREARM_R))
_DOUBTFUL, _SURE = 0.5, 0.9
_BETTER = 0.985
_STEPS = 5


class SecondThoughts:
    """Takes turns over the arms and the proposals."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._turn = 0
        self._remembered: dict[tuple[int, int], Float] = {}

    def reconsider(
        self, observation: Observation, posture: Posture, report: FitReport, confidence: Float
    ) -> tuple[Posture, FitReport]:
        """The posture, or one with a doubtful arm elsewhere where that explains the frame better.

        Args:
            confidence: (C,) of every capsule, in [0, 1].
        """
        doubtful = []
        for arm in _ARMS:
            sure = _arm_confidence(confidence, arm[1])
            if sure > _SURE:
                self._remembered[arm] = posture.rotations[list(arm)].copy()
            elif sure < _DOUBTFUL:
                doubtful.append(arm)
        if not doubtful:
            return posture, report
        start = self._proposal(posture, doubtful)
        tried, tried_report = self._fitter.fit(observation, start, iterations=_STEPS)
        _, same_report = self._fitter.fit(observation, posture, iterations=1)
        if tried_report.energy < _BETTER * same_report.energy:
            return tried, tried_report
        return posture, report

    def _proposal(self, posture: Posture, doubtful: list[tuple[int, int]]) -> Posture:
        """The posture with the next doubtful arm at the next place where it may be."""
        arm = doubtful[self._turn % len(doubtful)]
        places = [mirrored(posture.rotations)[list(arm)], *(pose[list(arm)] for pose in _POSES)]
        if arm in self._remembered:
            places.insert(0, self._remembered[arm])
        start = posture.copy()
        start.rotations[list(arm)] = places[(self._turn // len(doubtful)) % len(places)]
        self._turn += 1
        return start


def _arm_confidence(confidence: Float, fore: int) -> float:
    """The least certain of a forearm's and its hand's capsules."""
    return float(np.min(confidence[model.CAPSULES.frame == fore]))
