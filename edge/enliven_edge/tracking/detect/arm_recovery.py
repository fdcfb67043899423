"""Recovery of arms: tries a doubtful arm at several other positions, and fits it at the best one.

If a limb is close to the front of the trunk, the fit may confuse the two surfaces and get stuck. In films of
such limbs, four out of five wrong arms had a higher cost than the true pose. So a fit that starts with the
arm at another position often finds the true pose. A few steps on a third of the points show which start
deserves a full fit.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.arm_starts import ARM_JOINTS, Arm, arm_starts
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.proposals import FIT_STEPS, Doubts
from enliven_edge.tracking.fit.fit import Fitter

_DOUBTFUL_ENERGY_RATIO = 1.12
"""Both arms are doubtful if the energy exceeds the usual energy of the person's frames by this factor. Most
wrong arms exceed it."""
_ENERGY_FALL_RATE = 0.2
"""Weight of a frame with a lower energy in the usual energy, a running mean."""
_ENERGY_RISE_RATE = 0.01
"""Weight of a frame with a higher energy in the usual energy. It is low, so that a wrong arm does not become
usual."""
_MIN_SIGNS = 2
"""Minimum number of signs of a wrong arm, out of three: a higher energy than usual, a doubtful arm, and
disagreement with the network. Without the network one is enough. Of 954 attempts with one sign, 142 were
accepted: equal numbers of joints got better and worse. Of 583 attempts with two or three signs, 191 were
accepted: 70 frames got better and 21 got worse.
"""
_TRIALS_PER_FRAME = 4
"""Number of start poses tried per frame. With eight, 0.2 % more hands were right, but wrong joints had a
higher confidence.
"""
_MAX_ATTEMPT_INTERVAL = 3
"""Maximum number of frames between two attempts while no start pose is promising."""
_TRIAL_STEPS = 2
"""Steps of a coarse trial. Three steps did not improve the arms, one step made them worse."""
_TRIAL_STRIDE = 3
"""A coarse trial uses every n-th point, because it only compares start poses."""
_MAX_TRIAL_ENERGY = 0.97
"""Maximum energy after a coarse trial, relative to the present posture. Only start poses below it get a full
fit.
"""


class ArmRecovery:
    """Tries the doubtful arms of one person at other positions, a few per frame."""

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._turn = 0
        self._usual_energy = np.inf
        self._backoff = Backoff(_MAX_ATTEMPT_INTERVAL)

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Returns a fit with one arm at another position, or None if no position is promising."""
        costs_more = self._costs_more_than_usual(frame.report.energy)
        min_signs = 1 if frame.network_output is None else _MIN_SIGNS
        arms = [
            arm
            for arm in ARM_JOINTS
            if costs_more + (doubts.is_body_doubtful or arm in doubts.arms) + _network_disagrees(frame, arm)
            >= min_signs
        ]
        if not arms or not self._backoff.is_due(frame.report.energy):
            return None
        best = self._find_promising_start(frame, arms)
        self._backoff.record(frame.report.energy, better=best is not None)
        return None if best is None else self._fitter.fit(frame.observation, best, iterations=FIT_STEPS)

    def _find_promising_start(self, frame: FittedFrame, arms: list[Arm]) -> Posture | None:
        """Fits some start poses coarsely. Returns the best fit if it is promising."""
        starts = arm_starts(frame.observation, frame.posture, frame.network_output, arms)
        candidates = [
            starts[(self._turn + n) % len(starts)]() for n in range(min(_TRIALS_PER_FRAME, len(starts)))
        ]
        self._turn += _TRIALS_PER_FRAME
        thinned = frame.observation.thin(_TRIAL_STRIDE)
        present_fit, *other_fits = (
            self._fitter.fit(thinned, start, iterations=_TRIAL_STEPS)
            for start in (frame.posture, *candidates)
        )
        best = min(other_fits, key=lambda fit: fit[1].energy)
        is_promising = best[1].energy < _MAX_TRIAL_ENERGY * present_fit[1].energy
        return best[0] if is_promising else None

    def _costs_more_than_usual(self, energy: float) -> bool:
        """Records a frame's energy, and returns True if it is well above the usual energy of this person's
        frames.

        The usual energy is a running mean.
        """
        if np.isinf(self._usual_energy):
            self._usual_energy = energy
        step = energy - self._usual_energy
        self._usual_energy += (_ENERGY_FALL_RATE if step < 0.0 else _ENERGY_RISE_RATE) * step
        return energy > _DOUBTFUL_ENERGY_RATIO * self._usual_energy


def _network_disagrees(frame: FittedFrame, arm: Arm) -> bool:
    """Returns True if the network's position of a joint of the arm clearly differs from the posture's."""
    if frame.network_output is None:
        return False
    joints: Float = frame.posture.joints()
    return frame.network_output.estimate.count_disagreeing(joints, ARM_JOINTS[arm]) > 0
