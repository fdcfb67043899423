"""Prediction: extrapolates the joints to the time when the picture is seen."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.person import PARENTS
from enliven_edge.tracking.output.smoothing import step_between, turn

_PARENTS = np.array(PARENTS)
_CUTOFF = 3.0
"""Hz of the low-pass on the speeds: the prediction multiplies their noise, and must not shake."""
_FASTEST = 6.0
"""Metres a second that a joint is extrapolated at, at most: a fast hand; faster is mostly a bad frame."""
_FASTEST_TURN = 10.0
"""Radians a second that a bone is extrapolated at, at most: a fast forearm; faster is mostly a bad frame."""
_MOVES = 0.5
"""Metres a second at which half of a filter's delay is made up for: a joint that rests must not shake, and
what it lags by is nothing. On the tuning sequences a lag of 16 ms becomes 8 at 2 % more jitter."""
_TURNS = 3.0
"""Radians a second, the same of a bone that turns."""
_LONGEST_GAP = 0.5
"""Seconds between two frames beyond which no speed is taken from them."""


class Predictor:
    """Extrapolates one person's joints and orientations by their smoothed speeds; bones keep their length."""

    def __init__(self) -> None:
        self._joints: Float | None = None
        self._turns: Float | None = None
        self._speed = np.zeros((20, 3))
        self._spin = np.zeros((20, 3))
        self._time_ns = 0

    def __call__(
        self,
        joints: Float,
        turns: Float | None,
        time_ns: int,
        seconds: float,
        delay: Float,
        turn_delay: Float,
    ) -> tuple[Float, Float | None]:
        """Returns (20, 3) joints and (20, 4) orientations expected ``seconds`` after ``time_ns``.

        Args:
            delay: (20,) seconds by which the joints lie behind already, made up for where they move.
            turn_delay: (20,) seconds, the same of the orientations.
        """
        self._learn(joints, turns, time_ns)
        ahead = seconds + delay * _moving(self._speed, _MOVES)
        moved = moved_on(joints, self._speed, ahead) if ahead.any() else joints
        if turns is None:
            return moved, None
        ahead = seconds + turn_delay * _moving(self._spin, _TURNS)
        return moved, turned_on(turns, self._spin, ahead) if ahead.any() else turns

    def _learn(self, joints: Float, turns: Float | None, time_ns: int) -> None:
        """Updates the speeds by this frame and the last."""
        passed = (time_ns - self._time_ns) * 1e-9
        if self._joints is None or not 0.0 < passed < _LONGEST_GAP:
            self._speed[:] = 0.0
            self._spin[:] = 0.0
        else:
            share = 1.0 / (1.0 + 1.0 / (2 * np.pi * _CUTOFF * passed))
            self._speed += share * ((joints - self._joints) / passed - self._speed)
            if turns is not None and self._turns is not None:
                learn_spin(self._spin, self._turns, turns, passed, share)
        self._joints, self._turns, self._time_ns = joints, turns, time_ns


def _moving(velocity: Float, half: float) -> Float:
    """(J,) how much (J, 3) velocities count as movement: 0 at rest, 0.5 at the speed ``half``, at most 1."""
    square = (velocity**2).sum(1)
    return square / (square + half * half)


@njit(cache=True, nogil=True)
def learn_spin(spin, before, turns, passed, share):  # type: ignore[no-untyped-def]
    """Low-pass on (J, 3) spins, radians a second about each bone's own axes, in place.

    Args:
        before, turns: (J, 4) unit quaternions, ``passed`` seconds apart.
        share: of the difference that is taken over.
    """
    for j in range(len(spin)):
        x, y, z = step_between(before[j], turns[j])
        spin[j, 0] += share * (x / passed - spin[j, 0])
        spin[j, 1] += share * (y / passed - spin[j, 1])
        spin[j, 2] += share * (z / passed - spin[j, 2])


@njit(cache=True, nogil=True)
def turned_on(turns, spin, seconds):  # type: ignore[no-untyped-def]
    """(J, 4) turns after (J,) seconds at (J, 3) spins."""
    out = turns.copy()
    for j in range(len(out)):
        far = seconds[j] * _limit(spin[j], _FASTEST_TURN)
        turn(out[j], far * spin[j, 0], far * spin[j, 1], far * spin[j, 2])
    return out


@njit(cache=True, nogil=True)
def moved_on(joints, speed, seconds):  # type: ignore[no-untyped-def]
    """Returns (J, 3) joints after (J,) ``seconds`` at (J, 3) speeds; every bone keeps its length."""
    out = np.empty(joints.shape)
    for j in range(len(out)):
        far = seconds[j] * _limit(speed[j], _FASTEST)
        for a in range(3):
            out[j, a] = joints[j, a] + far * speed[j, a]
    for j in range(len(out)):  # parents come first
        parent = _PARENTS[j]
        if parent < 0:
            continue
        length = _length(out[j] - out[parent])
        if length > 1e-9:
            wanted = _length(joints[j] - joints[parent])
            for a in range(3):
                out[j, a] = out[parent, a] + (out[j, a] - out[parent, a]) * (wanted / length)
    return out


@njit(cache=True, nogil=True)
def _limit(velocity, most):  # type: ignore[no-untyped-def]
    """Returns the factor that makes a (3,) velocity no faster than ``most``."""
    return min(1.0, most / max(_length(velocity), 1e-9))


@njit(cache=True, nogil=True)
def _length(v):  # type: ignore[no-untyped-def]
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
