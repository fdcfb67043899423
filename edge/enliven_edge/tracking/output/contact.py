"""Foot contacts: detects which feet stand on the floor, by height and speed, with hysteresis."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import copy_row, njit
from enliven.person import Joint

_MAX_STANDING_HEIGHT_M = 0.16
"""Maximum height of a foot joint above the floor while the foot stands."""
_MAX_STANDING_LIFT_M = 0.035
"""A foot that is this far above its standing height counts as lifted."""
_MAX_STANDING_SPEED_M_S = 0.35
"""A foot that moves at this speed counts as lifted."""
_STANDING_HYSTERESIS = 1.25
"""Factor on both limits for a standing foot, so that contact does not flicker."""
STANDING_LIMITS = (
    _MAX_STANDING_HEIGHT_M,
    _MAX_STANDING_LIFT_M,
    _MAX_STANDING_SPEED_M_S,
    _STANDING_HYSTERESIS,
)
"""The limits of a standing foot in the order of the arguments of :func:`update_contacts`."""

_POINTS = np.array([[Joint.FOOT_LEFT, Joint.ANKLE_LEFT], [Joint.FOOT_RIGHT, Joint.ANKLE_RIGHT]])
"""(2, 2) the joints at ball and ankle of each foot. A foot may stand on either of them."""
_JOINT_HEIGHTS_M = np.array([0.0, 0.06])
"""(2,) height in metres of ball and ankle above the ball of a standing foot."""
_GROUND_RISE_RATE = 0.03
"""Rate in metres per second at which the remembered ground height of a standing foot may rise. The rise ends
the effect of a single frame with a foot that is too low.
"""
_SPEED_CUTOFF_HZ = 6.0
"""Cut-off in Hz of the low-pass on the speed of a foot. It suppresses the fit's noise, and a step is still
detected within a few frames."""
_LOGISTIC_SLOPE = 5.0
"""Slope of the logistic function that converts a foot's height and speed, relative to their limits, to a
probability. At half of the limits the probability is 0.92."""
_MAX_GAP_S = 1.0
"""Seconds without a frame after which the state of the feet is reset."""
_FULL_CONFIDENCE = 0.1
"""Minimum confidence of a foot's joints for its full contact probability. Below it, the probability is scaled
down in proportion."""
_STANDING_FRACTION = 0.6
"""A foot counts as standing in its first frame if it is below this fraction of the maximum height."""


class FootContacts:
    """Computes the probability that each foot of one person stands on the floor.

    A foot's height is measured relative to its last standing height, because the fit puts soles a few
    centimetres too high or too low. Because of hysteresis, a standing foot must be clearly lifted or moved
    before it counts as lifted.
    """

    def __init__(self) -> None:
        self._last: Float | None = None
        self._speed = np.zeros((2, 2))
        self._ground = np.zeros((2, 2))
        self._stands = np.zeros(2, bool)
        self._time_ns = 0

    def __call__(self, joints: Float, confidence: Float, time_ns: int) -> Float:
        """Returns the contact probabilities (2,) of left and right foot. The probability of a foot that is
        not visible is 0.

        Args:
            joints: (20, 3) metres, world frame, the floor at y = 0.
            confidence: (20,) of the joints.
            time_ns: the sensor's clock.
        """
        seconds = (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        if self._last is None or not 0.0 < seconds < _MAX_GAP_S:
            self._last, seconds = np.zeros((2, 2, 3)), 0.0
        feet = (self._last, self._speed, self._ground, self._stands)
        return np.asarray(update_contacts(joints, confidence, *feet, seconds, *STANDING_LIMITS))


@njit(cache=True, nogil=True, error_model="numpy")
def update_contacts(
    joints, confidence, last, speed, ground, stands, seconds, floor, lift, fastest, hysteresis
):
    """Returns (2,) contact probabilities, see :meth:`FootContacts.__call__`. Updates the feet's state in
    place.

    Args:
        joints: (20, 3) metres, world frame.
        confidence: (20,) of the joints.
        last: (2, 2, 3) metres, the last positions of the points of the feet.
        speed: (2, 2) metres per second, low-passed.
        ground: (2, 2) metres, the height of the points while the foot stands.
        stands: (2,) whether each foot is standing.
        seconds: time since the last frame; 0 without a last frame.
        floor, lift, fastest, hysteresis: the constants of this module.
    """
    out = np.empty(2)
    if seconds == 0.0:
        _initialise_feet(joints, speed, ground, stands, floor)
    else:
        _update_motion(joints, last, speed, ground, seconds, floor)
    for foot in range(2):
        stiff = hysteresis if stands[foot] else 1.0
        lowest, seen = np.inf, 0.0
        for k in range(2):
            place, highest = joints[_POINTS[foot, k]], floor + _JOINT_HEIGHTS_M[k]
            excess = max((place[1] - ground[foot, k]) / lift, speed[foot, k] / fastest) / stiff
            lowest = min(lowest, max(excess, place[1] / highest))
            seen = max(seen, confidence[_POINTS[foot, k]] / _FULL_CONFIDENCE)
            copy_row(last[foot, k], place)
        likely = 1.0 / (1.0 + np.exp(min(_LOGISTIC_SLOPE * (lowest - 1.0), 50.0)))
        stands[foot] = likely > 0.5
        out[foot] = likely * min(1.0, seen)
    return out


@njit(cache=True, nogil=True)
def _initialise_feet(joints, speed, ground, stands, floor):
    """Initialises the state of the feet in their first frame. A foot near the floor counts as standing."""
    for foot in range(2):
        stands[foot] = False
        for k in range(2):
            height, highest = joints[_POINTS[foot, k], 1], floor + _JOINT_HEIGHTS_M[k]
            ground[foot, k], speed[foot, k] = min(height, highest), 0.0
            stands[foot] |= height < _STANDING_FRACTION * highest


@njit(cache=True, nogil=True)
def _update_motion(joints, last, speed, ground, seconds, floor):
    """Updates the low-passed speed of the feet, and their recent minimum height."""
    follow = 1.0 / (1.0 + 1.0 / (2.0 * np.pi * _SPEED_CUTOFF_HZ * seconds))
    for foot in range(2):
        for k in range(2):
            place, before = joints[_POINTS[foot, k]], last[foot, k]
            x, y, z = place[0] - before[0], place[1] - before[1], place[2] - before[2]
            moved = np.sqrt(x * x + y * y + z * z) / seconds
            speed[foot, k] += follow * (moved - speed[foot, k])
            ground[foot, k] = min(
                place[1], ground[foot, k] + _GROUND_RISE_RATE * seconds, floor + _JOINT_HEIGHTS_M[k]
            )
