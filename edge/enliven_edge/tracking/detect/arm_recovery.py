"""Recovery of arms: a doubtful arm is tried in several other places, and the best place is fitted.

A limb close to the front of the trunk can be captured by the trunk's surface. In films of such limbs four out
of five wrong arms cost more than the true pose, so the fit only has to start elsewhere. A few steps on a
third of the points show which place is worth a full fit.
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

_DOUBTFUL_ENERGY_RATIO = 1.12
"""Factor on the usual energy of a person's frames above which both arms are doubtful. Most wrong arms exceed
it."""
_ENERGY_FALL_RATE = 0.2
"""Rate at which the usual energy follows a frame that costs less."""
_ENERGY_RISE_RATE = 0.01
"""Rate at which it follows a frame that costs more. It is low, so that a wrong arm does not become usual."""
_MIN_SIGNS = 2
"""Minimum number of signs of a wrong arm, out of three: the frame costs more than usual, the arm is doubtful,
the network sees it elsewhere. Without the network one is enough. Of 954 attempts with one sign 142 were
accepted, and as many joints got worse as better. Of 583 attempts with two or three signs 191 were accepted,
and 70 frames got better while 21 got worse."""
_TRIALS_PER_FRAME = 4
"""Places tried per frame. With eight, hands gained 0.2 %, but wrong joints had a higher confidence."""
_MAX_ATTEMPT_INTERVAL = 3
"""Maximum number of frames between two attempts while no place is promising."""
_TRIAL_STEPS = 2
"""Steps of a coarse trial. With three arms were no better, with one they were worse."""
_TRIAL_STRIDE = 3
"""A coarse trial uses every n-th point, because it only compares places."""
_MAX_TRIAL_ENERGY = 0.97
"""Maximum energy after a coarse trial, relative to that of the present posture, for a place to be worth a fit
of all points."""


class ArmRecovery:
    """Tries doubtful arms of one person in other places, some of the places in each frame."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._turn = 0
        self._usual = np.inf
        self._backoff = Backoff(_MAX_ATTEMPT_INTERVAL)

    def try_arms(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        doubtful: list[Arm],
        seen: EstimateAtPoints | None,
        *,
        steps: int,
    ) -> tuple[Posture, FitReport] | None:
        """Returns a fit with an arm elsewhere that may be better. None if no place is promising.

        Args:
            observation: the observed person.
            posture: the present posture.
            report: of its fit.
            doubtful: limbs that are already doubtful, including legs.
            seen: the network's estimate; None without the network.
            steps: steps of the full fit.
        """
        costs_more = self._costs_more_than_usual(report.energy)
        enough = 1 if seen is None else _MIN_SIGNS
        arms = [
            arm
            for arm in ARM_JOINTS
            if costs_more + (arm in doubtful) + _seen_elsewhere(posture, arm, seen) >= enough
        ]
        if not arms or not self._backoff.is_due(report.energy):
            return None
        starts = arm_starts(observation, posture, seen, arms)
        some = [starts[(self._turn + n) % len(starts)]() for n in range(min(_TRIALS_PER_FRAME, len(starts)))]
        self._turn += _TRIALS_PER_FRAME
        thinned = observation.thinned(_TRIAL_STRIDE)
        now, *other_starts = (
            self._fitter.fit(thinned, start, iterations=_TRIAL_STEPS) for start in (posture, *some)
        )
        best = min(other_starts, key=lambda fit: fit[1].energy)
        promising = best[1].energy < _MAX_TRIAL_ENERGY * now[1].energy
        self._backoff.tried(report.energy, better=promising)
        if not promising:
            return None
        return self._fitter.fit(observation, best[0], iterations=steps)

    def _costs_more_than_usual(self, energy: float) -> bool:
        """Records a frame's energy.

        Returns whether it is well above the usual energy of this person's frames.
        """
        if np.isinf(self._usual):
            self._usual = energy
        step = energy - self._usual
        self._usual += (_ENERGY_FALL_RATE if step < 0.0 else _ENERGY_RISE_RATE) * step
        return energy > _DOUBTFUL_ENERGY_RATIO * self._usual


def _seen_elsewhere(posture: Posture, arm: Arm, seen: EstimateAtPoints | None) -> bool:
    """Returns True if the network clearly sees a joint of an arm elsewhere."""
    joints: Float = posture.joints()
    return seen is not None and seen.estimate.count_apart(joints, ARM_JOINTS[arm]) > 0
