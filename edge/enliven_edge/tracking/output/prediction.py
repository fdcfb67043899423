"""Prediction: extrapolates the joints to the time at which the picture is displayed."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.person import PARENTS
from enliven_edge.tracking.output.smoothing import step_between, turn

_PARENTS = np.array(PARENTS)
_CUTOFF_HZ = 3.0
"""Cut-off in Hz of the low-pass on the speeds. The prediction multiplies their noise, and must not jitter."""
_MAX_SPEED = 6.0
"""Maximum speed in metres per second at which a joint is extrapolated: a fast hand. Higher speeds are mostly
errors of single frames."""
_MAX_TURN_RATE = 10.0
"""Maximum angular speed in radians per second at which a bone is extrapolated: a fast forearm. Higher speeds
are mostly errors of single frames."""
_HALF_SPEED = 0.5
"""Speed in metres per second at which half of the smoothing filter's delay is compensated. At rest nothing is
compensated, because a joint at rest must not jitter and has no visible lag. On the tuning sequences this
reduces a lag of 16 ms to 8 ms, with 2 % more jitter."""
_HALF_TURN_RATE = 3.0
"""Angular speed in radians per second at which half of the delay of a bone's rotation is compensated."""
_MAX_GAP_S = 0.5
"""Maximum seconds between two frames for a speed to be computed from them."""


class Predictor:
    """Extrapolates one person's joints and orientations by their smoothed speeds. Keeps bone lengths."""

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
            joints: (20, 3) metres.
            turns: (20, 4) unit quaternions, or None.
            time_ns: the sensor's clock.
            seconds: the prediction time.
            delay: (20,) current lag of the joints in seconds. It is compensated for moving joints.
            turn_delay: (20,) current lag of the orientations in seconds.
        """
        passed = (time_ns - self._time_ns) * 1e-9
        if self._joints is None or not 0.0 < passed < _MAX_GAP_S:
            passed = 0.0
        if passed == seconds == 0.0:
            self._speed[:], self._spin[:] = 0.0, 0.0
            self._joints, self._turns, self._time_ns = joints, turns, time_ns
            return joints, turns
        old_joints, turned = joints if self._joints is None else self._joints, None
        moved = predict_joints(joints, old_joints, self._speed, delay, passed, seconds)
        if turns is not None:
            elapsed_s = 0.0 if self._turns is None else passed
            facing = turns if self._turns is None else self._turns
            turned = np.asarray(predict_rotations(turns, facing, self._spin, turn_delay, elapsed_s, seconds))
        self._joints, self._turns, self._time_ns = joints, turns, time_ns
        return np.asarray(moved), turned


@njit(cache=True, nogil=True)
def predict_joints(joints, before, speed, delay, passed, seconds):
    """Returns (J, 3) the predicted joints, and updates their (J, 3) speeds with this frame.

    Args:
        joints: (J, 3) metres.
        before: (J, 3) the joints of the previous frame.
        speed: (J, 3) metres per second, updated.
        delay: (J,) seconds that are compensated for moving joints.
        passed: seconds since the previous frame. Without a previous frame it is 0, and nothing moves.
        seconds: the prediction time.
    """
    share = _speed_weight(passed)
    for j in range(len(joints)):
        for a in range(3):
            moved = (joints[j, a] - before[j, a]) / passed if passed > 0.0 else 0.0
            speed[j, a] += share * (moved - speed[j, a])
    return move_for(joints, speed, prediction_times(speed, delay, seconds, _HALF_SPEED))


@njit(cache=True, nogil=True)
def predict_rotations(turns, before, spin, delay, passed, seconds):
    """Returns (J, 4) the predicted rotations, and updates their (J, 3) angular velocities in radians per
    second."""
    if passed > 0.0:
        update_spin(spin, before, turns, passed, _speed_weight(passed))
    else:
        spin[:] = 0.0
    return rotate_for(turns, spin, prediction_times(spin, delay, seconds, _HALF_TURN_RATE))


@njit(cache=True, nogil=True)
def _speed_weight(passed):
    """Returns the weight of a new speed in the low-pass after ``passed`` seconds. The first speed has weight
    1.
    """
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * _CUTOFF_HZ * passed)) if passed > 0.0 else 1.0


@njit(cache=True, nogil=True)
def prediction_times(velocity, delay, seconds, half):
    """Returns (J,) seconds to predict: ``seconds``, plus the part of the delay that the velocity justifies.

    That part is 0 at rest, half of the delay at the speed ``half``, and nearly the whole delay at much higher
    speeds.
    """
    out = np.empty(len(velocity))
    for j in range(len(velocity)):
        square = velocity[j, 0] ** 2 + velocity[j, 1] ** 2 + velocity[j, 2] ** 2
        out[j] = seconds + delay[j] * square / (square + half * half)
    return out


@njit(cache=True, nogil=True)
def update_spin(spin, before, turns, passed, share):
    """Updates the low-pass filtered (J, 3) angular velocities in place.

    They are in radians per second about each bone's own axes.

    Args:
        spin: (J, 3) the state.
        before, turns: (J, 4) unit quaternions, ``passed`` seconds apart.
        passed: seconds.
        share: weight of the new value.
    """
    for j in range(len(spin)):
        x, y, z = step_between(before[j], turns[j])
        spin[j, 0] += share * (x / passed - spin[j, 0])
        spin[j, 1] += share * (y / passed - spin[j, 1])
        spin[j, 2] += share * (z / passed - spin[j, 2])


@njit(cache=True, nogil=True)
def rotate_for(turns, spin, seconds):
    """Returns (J, 4) rotations after (J,) seconds at (J, 3) angular velocities."""
    out = turns.copy()
    for j in range(len(out)):
        far = seconds[j] * _speed_limit_factor(spin[j], _MAX_TURN_RATE)
        turn(out[j], far * spin[j, 0], far * spin[j, 1], far * spin[j, 2])
    return out


@njit(cache=True, nogil=True)
def move_for(joints, speed, seconds):
    """Returns (J, 3) joints after (J,) ``seconds`` at (J, 3) velocities. Keeps bone lengths."""
    out = np.empty(joints.shape)
    for j in range(len(out)):
        far = seconds[j] * _speed_limit_factor(speed[j], _MAX_SPEED)
        for a in range(3):
            out[j, a] = joints[j, a] + far * speed[j, a]
    for j in range(len(out)):  # Parents come before their children.
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
def _speed_limit_factor(velocity, most):
    """Returns the factor that limits a (3,) velocity to ``most``."""
    return min(1.0, most / max(_length(velocity), 1e-9))


@njit(cache=True, nogil=True)
def _length(v):
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
