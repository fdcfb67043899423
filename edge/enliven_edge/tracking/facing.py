"""Which way somebody faces: front and back look alike, so it is decided over many frames."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.parts.proposals import Seen, agreement, turned_about
from enliven_edge.tracking import model
from enliven_edge.tracking.posture import Posture

_MEMORY = 12.0
"""Frames over which agreement is averaged."""
_PATIENCE = 10
"""Frames before a first verdict."""
_FRONT, _BACK = 0.27, 0.04
"""By how much the forest's parts agree more with a front than with a back, for fronts and for backs: it takes
a back for a front more easily than the other way round."""
_MARGIN = 0.06
_SIDEWAYS = 0.5
"""Cosine of the angle to the sensor below which the two expectations are blended to nothing."""


class Facing:
    """Watches whether the parts agree better with the posture turned about."""

    def __init__(self) -> None:
        self._advantage = 0.0
        self._frames = 0

    def is_wrong(self, seen: Seen, posture: Posture, eye: Float) -> bool:
        """Whether the posture has been facing the wrong way for a while.

        Args:
            eye: (3,) the sensor, world frame.
        """
        towards = _towards(posture, eye)
        advantage = agreement(seen, posture) - agreement(seen, turned_about(posture))
        # What the advantage of the truth would be on average, and of its opposite.
        blend = min(1.0, abs(towards) / _SIDEWAYS)
        middle = 0.5 * (_FRONT + _BACK) * blend * (1.0 if towards > 0 else -1.0)
        self._frames += 1
        rate = max(1.0 / _MEMORY, 1.0 / self._frames)
        self._advantage += rate * (advantage - middle - self._advantage)
        wrong = self._frames >= _PATIENCE and self._advantage < -_MARGIN
        if wrong:
            self._advantage, self._frames = 0.0, 0
        return wrong


def _towards(posture: Posture, eye: Float) -> float:
    """The cosine between the chest's front and the way to the sensor, in plan."""
    chest = posture.rotations[model.PELVIS] @ posture.rotations[model.CHEST]
    ahead, way = chest[[0, 2], 2], (eye - posture.position)[[0, 2]]
    return float(ahead @ way / (np.linalg.norm(ahead) * np.linalg.norm(way) + 1e-9))
