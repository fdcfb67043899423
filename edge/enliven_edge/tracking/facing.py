"""Which way somebody faces: front and back look alike, so it is decided over many frames.

Two things tell: which parts the forest sees where (with the posture as it is against the posture turned
about), and that people walk forward.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.parts.proposals import Seen, agreement, turned_about
from enliven_edge.tracking import model
from enliven_edge.tracking.posture import Posture

_MEMORY = 15.0
"""Frames over which the evidence is averaged."""
_PATIENCE = 15
"""Frames before a first verdict."""
_DOUBTED = ((-1.0, -0.10), (0.0, -0.06), (0.6, 0.08), (1.0, 0.19))
"""By how much the parts must agree better with the posture as it is, by the cosine of its angle to the sensor.
The forest takes a back for a front more easily than the other way round: it agrees with a front by 0.27 more
than with a back where it is one, and still by 0.15 where it is not (on the tuning sequences)."""
_SETTLED, _UNSETTLED = 0.05, -0.10
"""Beyond what is asked for: from which on a facing is settled, and below which even a settled one is wrong."""
_SEEN_WELL = 0.3
"""Agreement below which the posture is too poor to tell."""
_STROLL, _WALK = 0.45, 0.9
"""Metres a second from which walking says something, and from which it says all it can."""
_FORWARD = 0.25
"""What walking ahead is worth, as a difference of agreements."""


class Facing:
    """Watches whether a posture has been facing the wrong way."""

    def __init__(self) -> None:
        self._surplus = 0.0
        self._frames = 0
        self._settled = False

    def is_wrong(self, seen: Seen, posture: Posture, eye: Float, velocity: Float) -> bool:
        """Whether the posture has been facing the wrong way for a while.

        Args:
            eye: (3,) the sensor, world frame.
            velocity: (3,) metres a second of the hip centre.
        """
        agrees, ahead = agreement(seen, posture), forward_in_plan(posture)
        if agrees < _SEEN_WELL:
            return False
        way = (eye - posture.position)[[0, 2]]
        towards = float(ahead @ way / (np.linalg.norm(way) + 1e-9))
        asked = float(np.interp(towards, *zip(*_DOUBTED, strict=True)))
        surplus = agrees - agreement(seen, turned_about(posture)) - asked
        surplus += _FORWARD * _walking(velocity[[0, 2]], ahead)
        self._frames += 1
        self._surplus += max(1.0 / _MEMORY, 1.0 / self._frames) * (surplus - self._surplus)
        if self._frames < _PATIENCE:
            return False
        self._settled = self._settled or self._surplus > _SETTLED
        wrong = self._surplus < (_UNSETTLED if self._settled else 0.0)
        if wrong:
            self._surplus, self._frames, self._settled = 0.0, 0, False
        return wrong


def forward_in_plan(posture: Posture) -> Float:
    """(2,) the unit (x, z) direction that the chest faces, by the line of its shoulders: bent over or not."""
    chest = posture.rotations[model.PELVIS] @ posture.rotations[model.CHEST]
    left = chest[:, 0]
    ahead = np.array([-left[2], left[0]])
    return np.asarray(ahead / (np.linalg.norm(ahead) + 1e-9))


def _walking(velocity: Float, ahead: Float) -> float:
    """In [-1, 1]: how plainly somebody walks the way they face."""
    speed = float(np.linalg.norm(velocity))
    if speed < _STROLL:
        return 0.0
    return min(1.0, (speed - _STROLL) / (_WALK - _STROLL)) * float(velocity @ ahead) / speed
