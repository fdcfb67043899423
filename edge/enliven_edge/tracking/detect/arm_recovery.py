"""Recovery of arms: where one is doubted, it is tried in other places at once, and the best one is fitted.

A limb close before the trunk is caught in its surface: of the wrong arms in films of such limbs four in five
cost more than the truth does, so the fit only has to be begun elsewhere. A few steps on a third of the points
tell which place is worth a fit.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import Posture
from enliven_edge.tracking.detect.appearance import EstimateAtPoints
from enliven_edge.tracking.detect.arm_starts import ARM_JOINTS, Arm, arm_starts
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import Observation

_WORSE = 1.12
"""Times the usual energy of a person's frames from which both arms are doubted: most wrong ones exceed it."""
_FALLS = 0.2
"""Share by which the usual energy follows a frame that costs less."""
_RISES = 0.01
"""Share by which it follows a frame that costs more: slowly, or a wrong arm would become usual."""
_SIGNS = 2
"""Signs of a wrong arm, of three: the frame costs more than usual, the arm is doubted, the network sees it
elsewhere; one is enough without the network. Of 954 looks at one sign 142 were taken, and as many joints got
worse as better; of 583 at two or three 191 were, and 70 frames got better for 21 that got worse."""
_GLANCES = 4
"""Places looked at in a frame: with eight, hands gained 0.2 % and wrong joints were surer."""
_RAREST = 3
"""Frames between two looks at most while no place is hopeful."""
_GLANCE = 2
"""Steps of a glance: with three arms were no better, with one they were worse."""
_THINNED = 3
"""A glance uses one point of so many: it only compares."""
_HOPEFUL = 0.97
"""Times the present posture's energy after a glance up to which a place is worth a fit of all points."""


class ArmRecovery:
    """Tries doubted arms of one person in other places, some of the places in each frame."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._turn = 0
        self._usual = np.inf
        self._backoff = Backoff(_RAREST)

    def tried(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        doubtful: list[Arm],
        seen: EstimateAtPoints | None,
        *,
        steps: int,
    ) -> tuple[Posture, FitReport] | None:
        """Returns a fit of so many steps with an arm elsewhere that may be better; None: no place is hopeful.

        Args:
            doubtful: limbs that are doubted already, legs among them.
        """
        worse = self._costs_more_than_usual(report.energy)
        enough = 1 if seen is None else _SIGNS
        arms = [
            arm
            for arm in ARM_JOINTS
            if worse + (arm in doubtful) + _seen_elsewhere(posture, arm, seen) >= enough
        ]
        if not arms or not self._backoff.is_due(report.energy):
            return None
        starts = arm_starts(observation, posture, seen, arms)
        some = [starts[(self._turn + n) % len(starts)]() for n in range(min(_GLANCES, len(starts)))]
        self._turn += _GLANCES
        thinned = observation.thinned(_THINNED)
        now, *others = (self._fitter.fit(thinned, start, iterations=_GLANCE) for start in (posture, *some))
        best = min(others, key=lambda fit: fit[1].energy)
        hopeful = best[1].energy < _HOPEFUL * now[1].energy
        self._backoff.tried(report.energy, better=hopeful)
        if not hopeful:
            return None
        return self._fitter.fit(observation, best[0], iterations=steps)

    def _costs_more_than_usual(self, energy: float) -> bool:
        """Takes in a frame's energy; returns whether it is well above what this person's frames cost."""
        if np.isinf(self._usual):
            self._usual = energy
        step = energy - self._usual
        self._usual += (_FALLS if step < 0.0 else _RISES) * step
        return energy > _WORSE * self._usual


def _seen_elsewhere(posture: Posture, arm: Arm, seen: EstimateAtPoints | None) -> bool:
    """Whether the network plainly sees a joint of an arm elsewhere."""
    joints: Float = posture.joints()
    return seen is not None and seen.estimate.count_apart(joints, ARM_JOINTS[arm]) > 0
