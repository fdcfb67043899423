"""Prediction: where the joints will be when the picture is seen."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.body import PARENTS
from enliven.rotation import conjugate, from_rotation_vector, multiply, to_rotation_vector

_CUTOFF = 3.0
"""Hz of the low-pass on the speeds: what is extrapolated must not shake."""
_FASTEST, _FASTEST_TURN = 6.0, 10.0
"""Metres and radians a second: no more is extrapolated."""
_LONGEST_GAP = 0.5


class Ahead:
    """Extrapolates one person's joints and orientations by their smoothed speeds; bones keep their length."""

    def __init__(self) -> None:
        self._joints: Float | None = None
        self._turns: Float | None = None
        self._speed = np.zeros((20, 3))
        self._spin = np.zeros((20, 3))
        self._time_ns = 0

    def __call__(
        self, joints: Float, turns: Float | None, time_ns: int, seconds: float
    ) -> tuple[Float, Float | None]:
        """(20, 3) joints and (20, 4) orientations expected ``seconds`` after ``time_ns``."""
        self._learn(joints, turns, time_ns)
        if seconds <= 0.0:
            return joints, turns
        moved = joints + seconds * _limited(self._speed, _FASTEST)
        _restore_lengths(moved, joints)
        if turns is not None:
            turns = multiply(turns, from_rotation_vector(seconds * _limited(self._spin, _FASTEST_TURN)))
        return moved, turns

    def _learn(self, joints: Float, turns: Float | None, time_ns: int) -> None:
        """The speeds, from this frame and the last."""
        passed = (time_ns - self._time_ns) * 1e-9
        if self._joints is None or not 0.0 < passed < _LONGEST_GAP:
            self._speed[:] = 0.0
            self._spin[:] = 0.0
        else:
            share = 1.0 / (1.0 + 1.0 / (2 * np.pi * _CUTOFF * passed))
            self._speed += share * ((joints - self._joints) / passed - self._speed)
            if turns is not None and self._turns is not None:
                step = to_rotation_vector(multiply(conjugate(self._turns), turns))
                self._spin += share * (step / passed - self._spin)
        self._joints, self._turns, self._time_ns = joints, turns, time_ns


def _limited(velocity: Float, most: float) -> Float:
    """(20, 3) no longer than ``most``."""
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    return np.asarray(velocity * np.minimum(1.0, most / np.maximum(speed, 1e-9)))


def _restore_lengths(moved: Float, before: Float) -> None:
    """Gives every bone of ``moved`` the length it has in ``before``, parents first."""
    for joint, parent in enumerate(PARENTS):
        if parent < 0:
            continue
        bone = moved[joint] - moved[parent]
        length = np.sqrt(bone @ bone)
        wanted = before[joint] - before[parent]
        if length > 1e-9:
            moved[joint] = moved[parent] + bone * (np.sqrt(wanted @ wanted) / length)
