"""A tracked person in one frame, with the fit that proposals of other postures must improve."""

from __future__ import annotations

from dataclasses import dataclass

from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import EstimateAtPoints
from enliven_edge.tracking.fit.fit import FitReport
from enliven_edge.tracking.frame.observation import Observation

Fit = tuple[Posture, FitReport]
"""A posture and the report of its fit."""


@dataclass(frozen=True)
class FittedFrame:
    """A person in one frame, fitted.

    Attributes:
        observation: the observed person.
        posture: the fitted posture.
        report: the report of its fit.
        network_output: the network's estimate of the frame; None without the network.
    """

    observation: Observation
    posture: Posture
    report: FitReport
    network_output: EstimateAtPoints | None = None

    def count_disagreeing(self) -> int:
        """Returns the number of joints that the network sees elsewhere, 0 without the network."""
        if self.network_output is None:
            return 0
        return self.network_output.estimate.count_disagreeing(self.posture.joints())
