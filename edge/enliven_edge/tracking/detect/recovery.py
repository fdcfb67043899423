"""Recovery: schedules proposals of other postures for a doubtful limb or body, and accepts better ones.

A fit to the nearest surface cannot free a limb that is stuck to another limb's surface, or turn a body that
faces the wrong way. In both cases a wrong part of the model already explains the observed pixels. A fit that
starts at another position can recover the posture. It is accepted if it explains the frame better.
"""

from __future__ import annotations

from functools import cached_property

from enliven.arrays import Float
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT_COST,
    EstimateAtPoints,
    network_agreement,
)
from enliven_edge.tracking.detect.arm_recovery import ArmRecovery
from enliven_edge.tracking.detect.body_proposals import BodyProposer, face_same_way
from enliven_edge.tracking.detect.fit_quality import fit_quality
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.proposals import (
    Doubts,
    LimbProposer,
    NetworkProposer,
    Proposer,
)
from enliven_edge.tracking.fit.fit import FitReport, Fitter

_MAX_UNEXPLAINED = 0.03
"""Maximum additional fraction of points that an accepted posture may leave unexplained. Without this limit
the fit lost a visible leg, because the network had not learnt such a kick and placed the leg elsewhere."""
_DOUBTFUL_QUALITY = 0.9
"""Minimum quality, see :func:`fit_quality.fit_quality`. Below it the whole body is doubtful."""


class PoseRecovery:
    """Schedules the proposals for one person: arms in every frame, and one of the other kinds."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._arms, self._network = ArmRecovery(fitter), NetworkProposer(fitter)
        self._limbs, self._bodies = LimbProposer(fitter), BodyProposer(fitter)
        self._turn = 0

    def reconsider(self, frame: FittedFrame, confidence: Float, *, arms: bool = True) -> Fit:
        """Returns the frame's fit, or a better one with a doubtful limb or the whole body elsewhere.

        Args:
            frame: the person in this frame.
            confidence: (C,) confidence of every capsule in [0, 1].
            arms: whether there is time to try other positions of the arms.
        """
        doubts = self._find_doubts(frame, confidence)
        self._turn += 1
        present = _PresentFit(self._fitter, frame)
        for proposer in (self._arms, *self._choose(doubts)) if arms else self._choose(doubts):
            fit = proposer.propose(frame, doubts)
            if fit is None:
                continue
            # Only a doubtful body may turn around.
            is_accepted = doubts.is_body_doubtful or face_same_way(fit[0], frame.posture)
            is_accepted = is_accepted and present.is_worse_than(fit, proposer.max_cost_ratio)
            proposer.record(frame, accepted=is_accepted)
            if is_accepted:
                return fit
        return frame.posture, frame.report

    def _find_doubts(self, frame: FittedFrame, confidence: Float) -> Doubts:
        limbs = self._limbs.find_doubtful(frame.posture, confidence)
        is_body_doubtful = fit_quality(frame.report) < _DOUBTFUL_QUALITY
        has_disagreement = frame.count_disagreeing() > 0
        is_confirmed = frame.network_output is not None and not (is_body_doubtful or has_disagreement)
        return Doubts(limbs, is_body_doubtful, has_disagreement, is_confirmed)

    def _choose(self, doubts: Doubts) -> tuple[Proposer, ...]:
        """Returns the proposer besides the arms' whose turn it is, or none without a doubt.

        The network takes every other frame. The frames between are shared by limbs and bodies.
        """
        has_other_doubts = doubts.is_body_doubtful or bool(doubts.limbs)
        if doubts.has_disagreement and (self._turn % 2 or not has_other_doubts):
            return (self._network,)
        if doubts.is_body_doubtful and (not doubts.limbs or self._turn % 4 < 2):
            return (self._bodies,)
        return (self._limbs,) if doubts.limbs else ()


class _PresentFit:
    """The present posture of a frame, which a proposal must improve."""

    def __init__(self, fitter: Fitter, frame: FittedFrame) -> None:
        self._fitter, self._frame = fitter, frame

    @cached_property
    def _report(self) -> FitReport:
        """The report of the present posture without the temporal term, which proposals do not have."""
        return self._fitter.fit(self._frame.observation, self._frame.posture, iterations=1)[1]

    def is_worse_than(self, fit: Fit, max_cost_ratio: float) -> bool:
        """Returns True if a fit's cost is below ``max_cost_ratio`` times that of the present posture.

        The fit must not leave more points unexplained, either.
        """
        network_output, posture = self._frame.network_output, self._frame.posture
        present_cost = total_recovery_cost(self._report, posture, network_output)
        cost = total_recovery_cost(fit[1], fit[0], network_output)
        additional_unexplained = self._report.explained - fit[1].explained
        return cost < max_cost_ratio * present_cost and additional_unexplained <= _MAX_UNEXPLAINED


def total_recovery_cost(
    report: FitReport, posture: Posture, network_output: EstimateAtPoints | None
) -> float:
    """Returns the fit's energy plus the disagreement with the network, square centimetres per point."""
    return report.energy + (
        0.0
        if network_output is None
        else DISAGREEMENT_COST * (1.0 - network_agreement(network_output, posture))
    )
