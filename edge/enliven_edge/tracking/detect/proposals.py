"""Proposals of other postures: their common protocol, and the proposal from the network.

A proposal is another start of the fit. :class:`~recovery.PoseRecovery` decides which one is tried in a frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from enliven_edge.tracking.detect.arm_starts import Arm
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.hypotheses import align_to_estimate
from enliven_edge.tracking.fit.fit import Fitter

FIT_STEPS = 6
"""Steps of a proposal's fit. The ordinary fit uses the same number, so that both fits are comparable."""


@dataclass(frozen=True)
class Doubts:
    """The doubtful parts of a fitted frame.

    Attributes:
        arms: the arms that explain little of the frame.
        is_body_doubtful: True if the whole posture explains the frame badly.
    """

    arms: list[Arm]
    is_body_doubtful: bool


class Proposer(Protocol):
    """Proposes postures of one kind."""

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Returns the fit of the next proposal, or None if none is due in this frame."""
        ...


class NetworkProposer:
    """Proposes the posture with its joints where the network sees them, if it sees some elsewhere."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Aligns the posture with the joints that the network sees, then fits it."""
        if frame.network_output is None or not frame.count_disagreeing():
            return None
        start = align_to_estimate(frame.posture, frame.network_output.estimate)
        return self._fitter.fit(frame.observation, start, iterations=FIT_STEPS)
