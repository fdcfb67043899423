"""Which way somebody faces: front and back look alike, so it is decided over many frames.

Two things tell: what the network sees, and that people walk forward.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking import model
from enliven_edge.tracking.appearance import Seen, facing_score, turned_about
from enliven_edge.tracking.posture import Posture

_MEMORY, _PATIENCE = 15.0, 12
"""Frames over which the evidence is averaged, and before a first verdict."""
_SETTLED, _WRONG, _WRONG_ALL_THE_SAME = 1.0, -2.6, -3.5
"""Log probability by which the facing must be better than its opposite to be settled; below which it is
wrong; and below which even a settled one is."""
_STROLL, _WALK = 0.45, 0.9
"""Metres a second from which walking says something, and from which it says all it can."""
_FORWARD = 4.5
"""What walking ahead is worth, as a log probability."""
_UPRIGHT = 15.0
"""What it costs to lean backward, as a log probability a sine."""
_LEANS, _LIES = 0.15, 0.4
"""Sine from which a trunk leans backward, and of its rise below which it lies rather than leans."""


class Facing:
    """Watches whether a posture has been facing the wrong way."""

    def __init__(self) -> None:
        self._advantage = 0.0
        self._frames = 0
        self._settled = False

    def is_wrong(self, seen: Seen, posture: Posture, eye: Float, velocity: Float) -> bool:
        """Whether the posture has been facing the wrong way for a while.

        Args:
            eye: (3,) the sensor, world frame.
            velocity: (3,) metres a second of the hip centre.
        """
        turned = turned_about(posture)
        advantage = facing_score(seen, posture, eye) - facing_score(seen, turned, eye)
        advantage += _FORWARD * _walking(velocity[[0, 2]], forward_in_plan(posture))
        advantage += _UPRIGHT * (backward(turned) - backward(posture))
        self._frames += 1
        self._advantage += max(1.0 / _MEMORY, 1.0 / self._frames) * (advantage - self._advantage)
        if self._frames < _PATIENCE:
            return False
        self._settled = self._settled or self._advantage > _SETTLED
        wrong = self._advantage < (_WRONG_ALL_THE_SAME if self._settled else _WRONG)
        if wrong:
            self._advantage, self._frames, self._settled = 0.0, 0, False
        return wrong


def forward_in_plan(posture: Posture) -> Float:
    """(2,) the unit (x, z) direction that the chest faces, by the line of its shoulders: bent over or not."""
    chest = posture.rotations[model.PELVIS] @ posture.rotations[model.CHEST]
    left = chest[:, 0]
    ahead = np.array([-left[2], left[0]])
    return np.asarray(ahead / (np.linalg.norm(ahead) + 1e-9))


def backward(posture: Posture) -> float:
    """How far the trunk leans backward, as the sine beyond what is usual: people bend forward."""
    up = posture.rotations[model.PELVIS] @ posture.rotations[model.CHEST][:, 1]
    if up[1] < _LIES:
        return 0.0
    return max(0.0, -float(up[[0, 2]] @ forward_in_plan(posture)) - _LEANS)


def _walking(velocity: Float, ahead: Float) -> float:
    """In [-1, 1]: how plainly somebody walks the way they face."""
    speed = float(np.linalg.norm(velocity))
    if speed < _STROLL:
        return 0.0
    return min(1.0, (speed - _STROLL) / (_WALK - _STROLL)) * float(velocity @ ahead) / speed
