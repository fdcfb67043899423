"""Proposals of other postures: what they have in common, and the ones from the network and for single limbs.

A proposal is another start of the fit. :class:`~recovery.PoseRecovery` decides which one is tried in a frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import mirror_rotations, standing_pose
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.hypotheses import align_to_estimate
from enliven_edge.tracking.fit.fit import Fitter

Limb = tuple[int, ...]
"""A limb as the frames of the model, from the trunk outwards."""
_ARM_POSES = (
    standing_pose(arm_raise=0.15, arm_forward=0.1, elbow=1.5),
    standing_pose(arm_raise=0.2, elbow=0.15),
    standing_pose(arm_raise=1.4, elbow=0.1),
    standing_pose(arm_raise=0.2, arm_forward=1.5, elbow=0.2),
    standing_pose(arm_raise=2.5, elbow=0.4),
    standing_pose(arm_raise=0.3, arm_forward=1.0, elbow=2.2),
)
"""Arm poses: forearm forward, hanging, out, forward, overhead, hand at the face. Before these, two other
poses are tried: the limb's last confident pose, and the mirror image of the other side."""
_LEG_POSES = (
    standing_pose(),
    standing_pose(hip=1.4, knee=1.5),
    standing_pose(hip=0.3, knee=1.4),
    standing_pose(hip=0.7, knee=0.1),
)
"""Leg poses: standing, knee up, kneeling, kicking."""
ARMS = ((model.UPPER_ARM_L, model.FOREARM_L), (model.UPPER_ARM_R, model.FOREARM_R))
LEGS = (
    (model.THIGH_L, model.SHIN_L, model.FOOT_L),
    (model.THIGH_R, model.SHIN_R, model.FOOT_R),
)
_OUTER = {limb: np.flatnonzero(np.isin(model.CAPSULES.frame, limb[1:])).tolist() for limb in (*ARMS, *LEGS)}
"""The capsules of each limb beyond its first bone."""
_DOUBTFUL_CONFIDENCE = 0.5
"""Minimum confidence of a limb's outer capsules. Below it the limb is tried at other places."""
_TRUSTED_CONFIDENCE = 0.9
"""Minimum confidence of a limb's outer capsules for its pose to be remembered for later proposals."""
MAX_LIMB_COST = 0.985
"""Maximum cost with a moved limb, relative to the present cost, to accept it. Smaller gains are noise of the
fit."""
FIT_STEPS = 6
"""Steps of a proposal's fit. The ordinary fit uses the same number, so that both fits are comparable."""
_MAX_LIMB_INTERVAL = 6
"""Maximum number of frames between two failed limb trials if the network agrees with all joints. Of 1,445
trials in such frames 237 were accepted, and they did not make wrong limbs rarer.
"""


@dataclass(frozen=True)
class Doubts:
    """What is doubtful about a fitted frame.

    Attributes:
        limbs: the limbs that explain little of the frame.
        is_body_doubtful: True if the whole posture explains the frame badly.
        has_disagreement: True if the network sees a joint elsewhere.
        is_confirmed: True if the network agrees with a posture that explains the frame well.
    """

    limbs: list[Limb]
    is_body_doubtful: bool
    has_disagreement: bool
    is_confirmed: bool


class Proposer(Protocol):
    """Proposes postures of one kind."""

    max_cost_ratio: float
    """Maximum cost of an accepted proposal, relative to the present cost."""

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Returns the fit of the next proposal, or None if none is due in this frame."""
        ...

    def record(self, frame: FittedFrame, *, accepted: bool) -> None:
        """Records what became of the proposal of this frame."""
        ...


class NetworkProposer:
    """Proposes the posture with its joints where the network sees them."""

    max_cost_ratio = MAX_LIMB_COST

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Aligns the posture with the joints that the network sees, then fits it."""
        if frame.network_output is None:
            return None
        start = align_to_estimate(frame.posture, frame.network_output.estimate)
        return self._fitter.fit(frame.observation, start, iterations=FIT_STEPS)

    def record(self, frame: FittedFrame, *, accepted: bool) -> None:
        """Does nothing: the network's estimate is new in every frame."""


class LimbProposer:
    """Proposes a doubtful limb in other poses, one after the other."""

    max_cost_ratio = MAX_LIMB_COST

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._turn = 0
        self._backoff = Backoff(_MAX_LIMB_INTERVAL)
        self._is_confirmed = False
        self._remembered: dict[Limb, Float] = {}

    def find_doubtful(self, posture: Posture, confidence: Float) -> list[Limb]:
        """Returns the limbs that explain little of the frame. Remembers the poses of confident limbs.

        Args:
            posture: the fitted posture.
            confidence: (C,) confidence of every capsule in [0, 1].
        """
        doubtful: list[Limb] = []
        confidences = confidence.tolist()
        for limb, capsules in _OUTER.items():
            limb_confidence = min(confidences[c] for c in capsules)
            if limb_confidence > _TRUSTED_CONFIDENCE:
                # The frames of a limb are contiguous, so use a slice, which is cheaper than a list of
                # indices.
                self._remembered[limb] = posture.rotations[limb[0] : limb[-1] + 1].copy()
            elif limb_confidence < _DOUBTFUL_CONFIDENCE:
                doubtful.append(limb)
        return doubtful

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Fits the posture with the next doubtful limb in its next pose.

        Proposals are rarer while they fail and the network confirms the posture.
        """
        self._is_confirmed = doubts.is_confirmed
        if self._is_confirmed:
            if not self._backoff.is_due(frame.report.energy):
                return None
            self._backoff.start()
        start = self._move_next_limb(frame.posture, doubts.limbs)
        return self._fitter.fit(frame.observation, start, iterations=FIT_STEPS)

    def record(self, frame: FittedFrame, *, accepted: bool) -> None:
        """Records whether the proposal was accepted."""
        if self._is_confirmed:
            self._backoff.record(frame.report.energy, better=accepted)

    def _move_next_limb(self, posture: Posture, doubtful: list[Limb]) -> Posture:
        """Returns the posture with the next doubtful limb in the next pose to try."""
        turn, self._turn = self._turn, self._turn + 1
        limb = doubtful[turn % len(doubtful)]
        index = list(limb)
        poses = _ARM_POSES if limb in ARMS else _LEG_POSES
        places = [mirror_rotations(posture.rotations)[index], *(pose[index] for pose in poses)]
        if limb in self._remembered:
            places.insert(0, self._remembered[limb])
        start = posture.copy()
        start.rotations[index] = places[(turn // len(doubtful)) % len(places)]
        return start
