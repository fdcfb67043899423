"""The One-Euro filter (Casiez, Roussel, Vogel 2012) for the joints and the orientations of one person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven_edge.tracking.settings import SmoothingSettings

REST_CUTOFF_HZ = 3.0
"""Cut-off frequency at rest for amount 1. Lower values remove more jitter."""
CUTOFF_PER_SPEED = 4.0
"""Increase of the cut-off frequency with speed. Higher values reduce lag in fast motion. In Hz/(m/s)."""
CUTOFF_PER_TURN = 1.5
"""Increase of the cut-off frequency with rotation speed. Higher values reduce lag in fast turns. In
Hz/(rad/s)."""


class _Filter:
    """Base class of both filters: measures the time between values, resets after a gap, is off at amount 0.

    Attributes:
        amount: 0 is off, higher values are smoother. It may be changed at any time.
        delay: (J,) lag in seconds of the last result behind its input: the group delay of the low-pass at
            each joint's cut-off.
    """

    def __init__(self, settings: SmoothingSettings, amount: float | None = None) -> None:
        self.amount = settings.amount if amount is None else amount
        self._value: Float | None = None
        self._velocity = np.zeros((0, 3))
        self.delay = np.zeros(0)
        self._time_ns = 0

    def reset(self) -> None:
        """Forgets earlier values. Call it after a jump."""
        self._value = None

    def __call__(self, value: Float, time_ns: int) -> Float:
        """Returns the filtered value, or the input itself if the amount is 0.

        Args:
            value: (20, 3) metres, or (20, 4) unit quaternions.
            time_ns: the sensor's clock; a time that is not after the last one resets the filter.
        """
        seconds = (time_ns - self._time_ns) * 1e-9
        if self.amount == 0.0:
            self._value, self.delay = None, np.zeros(len(value))
            return value
        self._time_ns = time_ns
        if self._value is None or not 0.0 < seconds < 1.0:
            self._value, self._velocity = np.array(value, np.float64), np.zeros((len(value), 3))
            self.delay = np.zeros(len(value))
            return value
        self._value = self._filter_step(self._value, value, seconds)
        return self._value.copy()

    def _filter_step(self, filtered: Float, value: Float, seconds: float) -> Float:
        """Filters one more value and updates the velocity. May return the same array, modified."""
        raise NotImplementedError


class OneEuro(_Filter):
    """A low-pass for positions with a cut-off that rises with speed: no jitter at rest, little lag in motion.

    Each of the (20, 3) joints is filtered as one vector, so that the result does not depend on the world's
    axes.
    """

    def _filter_step(self, filtered: Float, value: Float, seconds: float) -> Float:
        raw = np.ascontiguousarray(value, np.float64)
        cutoff, slope = REST_CUTOFF_HZ / self.amount, CUTOFF_PER_SPEED / self.amount
        filter_places(filtered, self._velocity, self.delay, raw, seconds, cutoff, slope)
        return filtered


class OneEuroTurns(_Filter):
    """The One-Euro filter for (20, 4) rotations.

    Differences are rotation vectors in the filtered bone's own frame. So the result does not depend on the
    axes of the world or of the bone.
    """

    def _filter_step(self, filtered: Float, value: Float, seconds: float) -> Float:
        raw = np.ascontiguousarray(value, np.float64)
        cutoff, slope = REST_CUTOFF_HZ / self.amount, CUTOFF_PER_TURN / self.amount
        filter_turns(filtered, self._velocity, self.delay, raw, seconds, cutoff, slope)
        return filtered


@njit(cache=True, nogil=True, inline="always")
def _alpha(cutoff, seconds):
    """Returns the smoothing factor of a first-order low-pass: equation (5) of the One-Euro paper."""
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * seconds))


@njit(cache=True, nogil=True)
def filter_places(value, velocity, delay, raw, seconds, cutoff, slope):
    """Runs one step of the filter on (J, 3) positions, in place.

    Args:
        value, velocity: (J, 3) metres and (J, 3) metres per second, the state of the filter.
        delay: (J,) seconds, receives the group delay of this step.
        raw: (J, 3) the measurement, metres.
        seconds: time since the last step.
        cutoff: Hz at rest.
        slope: Hz per metre per second.
    """
    follow = _alpha(1.0, seconds)
    for j in range(len(value)):
        square = 0.0
        for a in range(3):
            velocity[j, a] += follow * ((raw[j, a] - value[j, a]) / seconds - velocity[j, a])
            square += velocity[j, a] ** 2
        share = _alpha(cutoff + slope * np.sqrt(square), seconds)
        delay[j] = seconds * (1.0 - share) / share
        for a in range(3):
            value[j, a] += share * (raw[j, a] - value[j, a])


@njit(cache=True, nogil=True)
def filter_turns(value, velocity, delay, raw, seconds, cutoff, slope):
    """Runs one step of the filter on (B, 4) rotations, in place.

    Args:
        value, velocity: (B, 4) unit quaternions and (B, 3) radians per second, the state of the filter.
        delay: (B,) seconds, receives the group delay of this step.
        raw: (B, 4) the measurement, unit quaternions.
        seconds: time since the last step.
        cutoff: Hz at rest.
        slope: Hz per radian per second.
    """
    follow = _alpha(1.0, seconds)
    for b in range(len(value)):
        sx, sy, sz = step_between(value[b], raw[b])
        velocity[b, 0] += follow * (sx / seconds - velocity[b, 0])
        velocity[b, 1] += follow * (sy / seconds - velocity[b, 1])
        velocity[b, 2] += follow * (sz / seconds - velocity[b, 2])
        speed = np.sqrt(velocity[b, 0] ** 2 + velocity[b, 1] ** 2 + velocity[b, 2] ** 2)
        share = _alpha(cutoff + slope * speed, seconds)
        delay[b] = seconds * (1.0 - share) / share
        turn(value[b], share * sx, share * sy, share * sz)


@njit(cache=True, nogil=True)
def step_between(q, r):
    """Returns (x, y, z) log(conj(q) r), radians: the shorter rotation between two (4,) unit quaternions."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    rw, rx, ry, rz = r[0], r[1], r[2], r[3]
    sw = w * rw + x * rx + y * ry + z * rz
    sx = w * rx - x * rw - y * rz + z * ry
    sy = w * ry + x * rz - y * rw - z * rx
    sz = w * rz - x * ry + y * rx - z * rw
    if sw < 0.0:
        sw, sx, sy, sz = -sw, -sx, -sy, -sz
    sine = np.sqrt(sx * sx + sy * sy + sz * sz)
    scale = 2.0 * np.arctan2(sine, sw) / sine if sine > 1e-12 else 2.0
    return scale * sx, scale * sy, scale * sz


@njit(cache=True, nogil=True)
def turn(q, x, y, z):
    """Replaces q (4,) by q exp(v), normalised, for the rotation vector v = (x, y, z) in q's own frame.

    The rotation vector is in radians.
    """
    angle = np.sqrt(x * x + y * y + z * z)
    scale = np.sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    c, x, y, z = np.cos(0.5 * angle), scale * x, scale * y, scale * z
    a, b, d, e = q[0], q[1], q[2], q[3]
    q[0] = a * c - b * x - d * y - e * z
    q[1] = a * x + b * c + d * z - e * y
    q[2] = a * y - b * z + d * c + e * x
    q[3] = a * z + b * y - d * x + e * c
    q /= np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
