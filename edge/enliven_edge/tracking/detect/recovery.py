"""Recovery: schedules proposals of other postures, and accepts those that explain the frame better.

A fit to the nearest surface cannot free a limb that is stuck to another limb's surface, because a wrong part
of the model already explains the observed pixels. A fit that starts at another position can recover the
posture.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT_COST,
    EstimateAtPoints,
    network_agreement,
)
from enliven_edge.tracking.detect.arm_recovery import ArmRecovery
from enliven_edge.tracking.detect.arm_starts import ARM_JOINTS
from enliven_edge.tracking.detect.fit_quality import fit_quality
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.proposals import (
    Doubts,
    NetworkProposer,
    Proposer,
)
from enliven_edge.tracking.fit.fit import FitReport, Fitter

_FOREARMS = {arm: np.flatnonzero(model.CAPSULES.frame == arm[1]).tolist() for arm in ARM_JOINTS}
"""The capsules of each arm beyond its upper arm."""
_DOUBTFUL_CONFIDENCE = 0.5
"""Minimum confidence of the capsules of a forearm. Below it the arm is doubtful."""
_MAX_COST_RATIO = 0.985
"""Maximum cost of an accepted proposal, relative to the present cost. Smaller gains are noise of the fit."""
MAX_UNEXPLAINED = 0.03
"""Maximum additional fraction of points that an accepted posture may leave unexplained. Without this limit
the fit lost a visible leg, because the network had not learnt such a kick and placed the leg elsewhere."""
_DOUBTFUL_QUALITY = 0.9
"""Minimum quality, see :func:`fit_quality.fit_quality`. Below it the whole body is doubtful."""


class PoseRecovery:
    """Schedules the proposals for one person: first arms, then the network's joints."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._proposers: tuple[Proposer, ...] = (ArmRecovery(fitter), NetworkProposer(fitter))

    def reconsider(self, frame: FittedFrame, confidence: Float) -> Fit:
        """Returns the frame's fit, or a better one with an arm or other joints elsewhere.

        Args:
            frame: the person in this frame.
            confidence: (C,) confidence of every capsule in [0, 1].
        """
        doubts = _find_doubts(frame, confidence)
        present = _PresentFit(self._fitter, frame)
        for proposer in self._proposers:
            fit = proposer.propose(frame, doubts)
            # Only a doubtful body may turn around.
            if (
                fit is not None
                and (doubts.is_body_doubtful or _face_same_way(fit[0], frame.posture))
                and present.is_worse_than(fit)
            ):
                return fit
        return frame.posture, frame.report


def _find_doubts(frame: FittedFrame, confidence: Float) -> Doubts:
    """Returns what is doubtful about a frame, given the (C,) confidence of every capsule in [0, 1]."""
    confidences = confidence.tolist()
    arms = [
        arm
        for arm, capsules in _FOREARMS.items()
        if min(confidences[c] for c in capsules) < _DOUBTFUL_CONFIDENCE
    ]
    is_body_doubtful = fit_quality(frame.report) < _DOUBTFUL_QUALITY
    return Doubts(arms, is_body_doubtful)


def _face_same_way(first: Posture, second: Posture) -> bool:
    """Returns True if two postures face within a right angle of each other, by hips and by shoulders."""
    orientations = [
        (p.rotations[model.PELVIS], p.rotations[model.PELVIS] @ p.rotations[model.CHEST])
        for p in (first, second)
    ]
    return all(bool(a[:, 0] @ b[:, 0] > 0) for a, b in zip(*orientations, strict=True))


class _PresentFit:
    """The present posture of a frame, which a proposal must improve."""

    def __init__(self, fitter: Fitter, frame: FittedFrame) -> None:
        self._fitter, self._frame = fitter, frame

    @cached_property
    def _report(self) -> FitReport:
        """The report of the present posture without the temporal term, which proposals do not have."""
        return self._fitter.fit(self._frame.observation, self._frame.posture, iterations=1)[1]

    def is_worse_than(self, fit: Fit) -> bool:
        """Returns True if a fit costs less, and does not leave more points unexplained."""
        network_output, posture = self._frame.network_output, self._frame.posture
        present_cost = total_recovery_cost(self._report, posture, network_output)
        cost = total_recovery_cost(fit[1], fit[0], network_output)
        additional_unexplained = self._report.explained - fit[1].explained
        return cost < _MAX_COST_RATIO * present_cost and additional_unexplained <= MAX_UNEXPLAINED


def total_recovery_cost(
    report: FitReport, posture: Posture, network_output: EstimateAtPoints | None
) -> float:
    """Returns the fit's energy plus the disagreement with the network, square centimetres per point."""
    return report.energy + (
        0.0
        if network_output is None
        else DISAGREEMENT_COST * (1.0 - network_agreement(network_output, posture))
    )
