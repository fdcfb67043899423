"""A tracked person in one frame, with the fit that proposals of other postures must improve."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.arrays import Float
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import EstimateAtPoints
from enliven_edge.tracking.detect.fit_quality import total_fit_cost
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

    @property
    def eye(self) -> Float:
        """Returns the sensor's (3,) position, world frame."""
        return self.observation.view.world_from_camera[:3, 3]

    def count_disagreeing(self) -> int:
        """Returns the number of joints that the network sees elsewhere, 0 without the network."""
        if self.network_output is None:
            return 0
        return self.network_output.estimate.count_disagreeing(self.posture.joints())

    def with_fit(self, fit: Fit) -> FittedFrame:
        """Returns the frame with another fit."""
        return replace(self, posture=fit[0], report=fit[1])

    def total_cost(self, fit: Fit, height: float) -> float:
        """Returns the total cost of a fit to this frame, see :func:`fit_quality.total_fit_cost`."""
        return total_fit_cost(fit[1], fit[0], self.network_output, self.eye, height)
