"""Recovery: tries a doubtful limb or body at other positions, one proposal per frame.

A fit to the nearest surface cannot free a limb that is stuck to another limb's surface, or turn a body that
faces the wrong way. In both cases a wrong part of the model already explains the observed pixels. A fit that
starts at another position can recover the posture. It is accepted if it explains the frame better.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import mirror_rotations, standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.detect.appearance import (
    DISAGREEMENT_COST,
    EstimateAtPoints,
    flip_posture,
    network_agreement,
)
from enliven_edge.tracking.detect.arm_recovery import ArmRecovery
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.detect.fit_quality import fit_quality
from enliven_edge.tracking.detect.hypotheses import BEHIND_SURFACE, align_to_estimate, pose_from_estimate
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.frame.observation import Observation

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
_ARMS = ((model.UPPER_ARM_L, model.FOREARM_L), (model.UPPER_ARM_R, model.FOREARM_R))
_LEGS = (
    (model.THIGH_L, model.SHIN_L, model.FOOT_L),
    (model.THIGH_R, model.SHIN_R, model.FOOT_R),
)
_OUTER = {limb: np.flatnonzero(np.isin(model.CAPSULES.frame, limb[1:])).tolist() for limb in (*_ARMS, *_LEGS)}
"""The capsules of each limb beyond its first bone."""
_DOUBTFUL_CONFIDENCE = 0.5
"""Minimum confidence of a limb's outer capsules. Below it the limb is tried at other places."""
_TRUSTED_CONFIDENCE = 0.9
"""Minimum confidence of a limb's outer capsules for its pose to be remembered for later proposals."""
_MAX_LIMB_COST = 0.985
"""Maximum cost with a moved limb, relative to the present cost, to accept it. Smaller gains are noise of the
fit."""
_MAX_BODY_COST = 0.8
"""Maximum cost of a moved body, relative to the present cost, to accept it. A wrong body is sometimes better
by chance."""
_MAX_UNEXPLAINED = 0.03
"""Maximum additional fraction of points that an accepted posture may leave unexplained. Without this limit
the fit lost a visible leg, because the network had not learnt such a kick and placed the leg elsewhere."""
_FIT_STEPS = 6
"""Steps of a proposal's fit. The ordinary fit uses the same number, so that both fits are comparable."""
_WIDE_STEPS = 6
"""Steps of the preceding wide fit of a whole body."""
_WIDE_WIDTH_M = 0.25
"""Robust width of the wide fit in metres. A limb of a proposal may be this far from its true position."""
_MAX_BODY_INTERVAL = 4
"""Maximum number of frames between two failed proposals of a whole body. It is short, so that a falling
person is recovered soon."""
_MAX_LIMB_INTERVAL = 6
"""Maximum number of frames between two failed limb trials if the network agrees with all joints. Of 1,445
trials in such frames 237 were accepted, and they did not make wrong limbs rarer.
"""
_DOUBTFUL_QUALITY = 0.9
"""Minimum quality, see :func:`fit_quality.fit_quality`. Below it the whole body is doubtful."""
_YAWS = (0.8, -0.8)
"""Rotations in radians at which a whole body is tried: about 45 degrees to either side."""
_ANKLE = 0.04
"""Height above the floor in metres of the foot joints of a proposed standing body."""


class PoseRecovery:
    """Proposes other positions for arms in every frame, and alternately for doubtful limbs and for the whole
    body.
    """

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._arms = ArmRecovery(fitter)
        self._turn = self._limb_turn = 0
        self._bodies, self._limbs = Backoff(_MAX_BODY_INTERVAL), Backoff(_MAX_LIMB_INTERVAL)
        self._remembered: dict[tuple[int, ...], Float] = {}
        self._proposals: Iterator[Posture] = iter(())

    def reconsider(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        confidence: Float,
        network_output: EstimateAtPoints | None = None,
        *,
        arms: bool = True,
    ) -> tuple[Posture, FitReport]:
        """Returns the posture, or a better one with a doubtful limb or the whole body at another position.

        Args:
            observation: the observed person.
            posture: the fitted posture.
            report: the report of its fit.
            confidence: (C,) confidence of every capsule in [0, 1].
            network_output: the network's estimate of the frame; None without the network.
            arms: whether there is time to try other positions of the arms.
        """
        doubtful = self._find_doubtful_limbs(posture, confidence)
        is_body_doubtful = fit_quality(report) < _DOUBTFUL_QUALITY
        has_disagreement = (
            network_output is not None and network_output.estimate.count_disagreeing(posture.joints()) > 0
        )
        self._turn += 1
        arms_to_try = [*doubtful, *_ARMS] if is_body_doubtful else doubtful
        checks_limbs = self._arms.try_arms
        arm = (
            checks_limbs(observation, posture, report, arms_to_try, network_output, steps=_FIT_STEPS)
            if arms
            else None
        )
        if arm is not None and self._is_better(arm, observation, posture, network_output, _MAX_LIMB_COST):
            return arm
        if not (is_body_doubtful or doubtful or has_disagreement):
            return posture, report
        is_confirmed = network_output is not None and not (is_body_doubtful or has_disagreement)
        if is_confirmed and not self._limbs.is_due(report.energy):
            return posture, report
        if (
            network_output is not None
            and has_disagreement
            and (self._turn % 2 or not (is_body_doubtful or doubtful))
        ):
            candidate = self._fit_to_estimate(observation, posture, network_output)
        elif is_body_doubtful and (not doubtful or self._turn % 4 < 2):
            return self._whole_body(observation, posture, report, network_output)
        else:
            start = self._move_next_limb(posture, doubtful) if doubtful else posture
            candidate = self._fitter.fit(observation, start, iterations=_FIT_STEPS)
        is_accepted = is_body_doubtful or _face_same_way(candidate[0], posture)
        is_accepted = is_accepted and self._is_better(
            candidate, observation, posture, network_output, _MAX_LIMB_COST
        )
        if is_confirmed:
            self._limbs.record(report.energy, better=is_accepted)
        return candidate if is_accepted else (posture, report)

    def _whole_body(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        network_output: EstimateAtPoints | None,
    ) -> tuple[Posture, FitReport]:
        """Returns the posture, or the next proposal of a whole body if it is due and much better."""
        if not self._bodies.is_due(report.energy):
            return posture, report
        candidate = self._fit_next_proposal(observation, posture, network_output)
        is_accepted = self._is_better(candidate, observation, posture, network_output, _MAX_BODY_COST)
        self._bodies.record(report.energy, better=is_accepted)
        return candidate if is_accepted else (posture, report)

    def _is_better(
        self,
        candidate: tuple[Posture, FitReport],
        observation: Observation,
        posture: Posture,
        network_output: EstimateAtPoints | None,
        max_cost_ratio: float,
    ) -> bool:
        """Returns True if the candidate's cost is below ``max_cost_ratio`` times that of ``posture``.

        Both costs exclude the temporal term.
        """
        _, same = self._fitter.fit(observation, posture, iterations=1)
        present_cost, candidate_cost = (
            total_recovery_cost(same, posture, network_output),
            total_recovery_cost(candidate[1], candidate[0], network_output),
        )
        return (
            candidate_cost < max_cost_ratio * present_cost
            and same.explained - candidate[1].explained <= _MAX_UNEXPLAINED
        )

    def _find_doubtful_limbs(self, posture: Posture, confidence: Float) -> list[tuple[int, ...]]:
        """Returns the limbs that explain little of the frame. Remembers the poses of confident limbs."""
        doubtful: list[tuple[int, ...]] = []
        sure_of = confidence.tolist()
        for limb, capsules in _OUTER.items():
            limb_confidence = min(sure_of[c] for c in capsules)
            if limb_confidence > _TRUSTED_CONFIDENCE:
                # The frames of a limb are contiguous, so use a slice, which is cheaper than a list of
                # indices.
                self._remembered[limb] = posture.rotations[limb[0] : limb[-1] + 1].copy()
            elif limb_confidence < _DOUBTFUL_CONFIDENCE:
                doubtful.append(limb)
        return doubtful

    def _fit_to_estimate(
        self, observation: Observation, posture: Posture, network_output: EstimateAtPoints
    ) -> tuple[Posture, FitReport]:
        """Aligns the posture with the joints that the network sees, then fits it."""
        return self._fitter.fit(
            observation, align_to_estimate(posture, network_output.estimate), iterations=_FIT_STEPS
        )

    def _fit_next_proposal(
        self, observation: Observation, posture: Posture, network_output: EstimateAtPoints | None
    ) -> tuple[Posture, FitReport]:
        """Fits the next proposal of a whole body, first with a wide and then with the usual robust width."""
        proposal = next(self._proposals, None)
        if proposal is None:
            self._proposals = propose_bodies(observation, posture, network_output)
            proposal = next(self._proposals)
        wide, _ = self._fitter.fit(observation, proposal, iterations=_WIDE_STEPS, width=_WIDE_WIDTH_M)
        return self._fitter.fit(observation, wide, iterations=_FIT_STEPS)

    def _move_next_limb(self, posture: Posture, doubtful: list[tuple[int, ...]]) -> Posture:
        """Returns the posture with the next doubtful limb in the next pose to try."""
        turn, self._limb_turn = self._limb_turn, self._limb_turn + 1
        limb = doubtful[turn % len(doubtful)]
        index = list(limb)
        poses = _ARM_POSES if limb in _ARMS else _LEG_POSES
        places = [mirror_rotations(posture.rotations)[index], *(pose[index] for pose in poses)]
        if limb in self._remembered:
            places.insert(0, self._remembered[limb])
        start = posture.copy()
        start.rotations[index] = places[(turn // len(doubtful)) % len(places)]
        return start


def total_recovery_cost(
    report: FitReport, posture: Posture, network_output: EstimateAtPoints | None
) -> float:
    """Returns the fit's energy plus the disagreement with the network, square centimetres per point."""
    return report.energy + (
        0.0
        if network_output is None
        else DISAGREEMENT_COST * (1.0 - network_agreement(network_output, posture))
    )


def propose_bodies(
    observation: Observation, posture: Posture, network_output: EstimateAtPoints | None
) -> Iterator[Posture]:
    """Yields proposals of a whole body: the network's estimate, slightly rotated postures, and standing ones.

    It never yields a rotation by 180 degrees. A body looks nearly the same from the back, and people do not
    turn that far in a frame.
    """
    if network_output is not None:
        proposed = pose_from_estimate(network_output.estimate, posture.lengths)
        yield proposed if _face_same_way(proposed, posture) else flip_posture(proposed)
    for yaw in _YAWS:
        turned = posture.copy()
        turned.rotations[model.PELVIS] = rotation(y=yaw) @ posture.rotations[model.PELVIS]
        yield turned
    ahead = posture.rotations[model.PELVIS][:, 2]
    facing = float(np.arctan2(ahead[0], ahead[2]))
    for yaw in (0.0, *_YAWS):
        yield _stand_at_points(observation, posture, facing + yaw)


def _face_same_way(first: Posture, second: Posture) -> bool:
    """Returns True if two postures face within a right angle of each other, by hips and by shoulders."""
    orientations = [
        (p.rotations[model.PELVIS], p.rotations[model.PELVIS] @ p.rotations[model.CHEST])
        for p in (first, second)
    ]
    return all(bool(a[:, 0] @ b[:, 0] > 0) for a, b in zip(*orientations, strict=True))


def _stand_at_points(observation: Observation, posture: Posture, facing: float) -> Posture:
    """Returns a standing posture at the position of the points, with the heading ``facing`` in radians."""
    person = Posture(posture.position.copy(), standing_pose(facing), posture.lengths.copy())
    centre = np.median(observation.points.astype(float), axis=0)
    backward = centre - observation.view.world_from_camera[:3, 3]
    backward[1] = 0.0
    person.position = centre + BEHIND_SURFACE * backward / max(1e-6, float(np.linalg.norm(backward)))
    lowest = person.joints()[:, 1].min() - person.position[1]
    person.position[1] = _ANKLE - lowest
    return person
