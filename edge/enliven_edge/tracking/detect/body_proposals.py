"""Proposals of a whole body: the network's estimate, slightly rotated postures, and standing ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, flip_posture
from enliven_edge.tracking.detect.backoff import Backoff
from enliven_edge.tracking.detect.fitted_frame import Fit, FittedFrame
from enliven_edge.tracking.detect.hypotheses import BEHIND_SURFACE, pose_from_estimate
from enliven_edge.tracking.detect.proposals import FIT_STEPS, Doubts
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import Observation

_MAX_BODY_COST = 0.8
"""Maximum cost of a moved body, relative to the present cost, to accept it. A wrong body is sometimes better
by chance."""
_WIDE_STEPS = 6
"""Steps of the preceding wide fit of a whole body."""
_WIDE_WIDTH_M = 0.25
"""Robust width of the wide fit in metres. A limb of a proposal may be this far from its true position."""
_MAX_BODY_INTERVAL = 4
"""Maximum number of frames between two failed proposals of a whole body. It is short, so that a falling
person is recovered soon."""
_YAWS = (0.8, -0.8)
"""Rotations in radians at which a whole body is tried: about 45 degrees to either side."""
_ANKLE = 0.04
"""Height above the floor in metres of the foot joints of a proposed standing body."""


class BodyProposer:
    """Proposes whole bodies, one after the other."""

    max_cost_ratio = _MAX_BODY_COST

    def __init__(self, fitter: Fitter) -> None:
        self._fitter = fitter
        self._backoff = Backoff(_MAX_BODY_INTERVAL)
        self._proposals: Iterator[Posture] = iter(())

    def propose(self, frame: FittedFrame, doubts: Doubts) -> Fit | None:
        """Fits the next proposal, first with a wide and then with the usual robust width."""
        if not self._backoff.is_due(frame.report.energy):
            return None
        self._backoff.start()
        proposal = next(self._proposals, None)
        if proposal is None:
            self._proposals = propose_bodies(frame.observation, frame.posture, frame.network_output)
            proposal = next(self._proposals)
        fit, observation = self._fitter.fit, frame.observation
        wide, _ = fit(observation, proposal, iterations=_WIDE_STEPS, width=_WIDE_WIDTH_M)
        return fit(observation, wide, iterations=FIT_STEPS)

    def record(self, frame: FittedFrame, *, accepted: bool) -> None:
        """Records whether the proposal was accepted."""
        self._backoff.record(frame.report.energy, better=accepted)


def propose_bodies(
    observation: Observation, posture: Posture, network_output: EstimateAtPoints | None
) -> Iterator[Posture]:
    """Yields proposals of a whole body: the network's estimate, slightly rotated postures, and standing ones.

    It never yields a rotation by 180 degrees. A body looks nearly the same from the back, and people do not
    turn that far in a frame.
    """
    if network_output is not None:
        proposed = pose_from_estimate(network_output.estimate, posture.lengths)
        yield proposed if face_same_way(proposed, posture) else flip_posture(proposed)
    for yaw in _YAWS:
        turned = posture.copy()
        turned.rotations[model.PELVIS] = rotation(y=yaw) @ posture.rotations[model.PELVIS]
        yield turned
    ahead = posture.rotations[model.PELVIS][:, 2]
    facing = float(np.arctan2(ahead[0], ahead[2]))
    for yaw in (0.0, *_YAWS):
        yield _stand_at_points(observation, posture, facing + yaw)


def face_same_way(first: Posture, second: Posture) -> bool:
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
