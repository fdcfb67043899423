"""Removes impossible values from the output: NaN, and limbs that jump across the room."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.person import PARENTS, Joint
from enliven.rotation import normalized

_MAX_JOINT_SPEED_M_S = 12.0
"""Maximum reported speed of a joint, in m/s. The limit is off if smoothing is 0."""
_JUMP_HOLD_S = 0.1
"""Time in seconds for which a joint waits after a jump above the maximum speed."""

_PARENTS = np.array([max(p, 0) for p in PARENTS])
_MAX_GAP_S = 1.0
"""After this gap between frames in seconds no speed limit applies, because a joint may be anywhere."""


def replace_nan_joints(joints: Float, confidence: Float, last: Float | None) -> tuple[Float, Float]:
    """Returns (20, 3) joints and (20,) confidence without NaN.

    A joint with NaN keeps its last position, with confidence 0.

    Without a last position the joint is placed at its parent. The root is placed at the mean of the other
    joints.
    """
    is_finite, clamped_confidence, are_all_finite = _check_joints(joints, confidence)
    if are_all_finite:
        return joints, clamped_confidence
    completed = np.where(is_finite[:, None], joints, 0.0 if last is None else last)
    if last is None:
        if not is_finite[Joint.HIP_CENTER]:
            completed[Joint.HIP_CENTER] = joints[is_finite].mean(0) if is_finite.any() else 0.0
        for joint in np.flatnonzero(~is_finite):
            if joint:
                completed[joint] = completed[_PARENTS[joint]]
    return completed, clamped_confidence


@njit(cache=True, nogil=True)
def _check_joints(joints, confidence):
    """Returns three values: (J,) whether each joint is finite, (J,) confidence in [0, 1], and whether all are
    finite.

    The confidence of a joint that is not finite is 0.
    """
    is_finite, sure, every = np.empty(len(joints), np.bool_), np.zeros(len(joints)), True
    for j in range(len(joints)):
        is_finite[j] = np.isfinite(joints[j, 0]) and np.isfinite(joints[j, 1]) and np.isfinite(joints[j, 2])
        every &= is_finite[j]
        if is_finite[j] and np.isfinite(confidence[j]):
            sure[j] = min(1.0, max(0.0, confidence[j]))
    return is_finite, sure, every


def replace_nan_rotations(orientations: Float, last: Float | None) -> Float:
    """Returns (20, 4) unit quaternions.

    Quaternions that are not finite are replaced by the last value, or by the identity.
    """
    if _are_units(orientations):
        return orientations
    length = np.einsum("ji,ji->j", orientations, orientations)
    usable = np.isfinite(length) & (length > 1e-12)
    unit_turns = normalized(orientations)
    return unit_turns if last is None else np.where(usable[:, None], unit_turns, last)


@njit(cache=True, nogil=True)
def _are_units(turns):
    """Returns True if all (J, 4) quaternions have unit length."""
    for j in range(len(turns)):
        w, x, y, z = turns[j]
        # Negate the comparison, so that a length of NaN fails as well.
        if not abs(w * w + x * x + y * y + z * z - 1.0) < 1e-6:
            return False
    return True


class SpeedLimit:
    """Delays a joint that moves faster than a person can.

    A joint jumps if it is farther from its last reported position than a limb can move in the time. It then
    waits for 0.1 seconds and only moves along with the hips. So one bad frame does not throw a limb across
    the room. If the new position is still far away after that, the joint follows at the maximum speed. Its
    confidence is 0 while it waits. While it follows, its confidence is multiplied by the fraction of the
    distance that the limit allows.
    """

    def __init__(self) -> None:
        self._last: Float | None = None
        self._waited = np.zeros(20)
        self._time_ns = 0

    def reset(self) -> None:
        """Forgets earlier frames."""
        self._last = None

    def __call__(self, joints: Float, confidence: Float, time_ns: int) -> tuple[Float, Float]:
        """Returns (20, 3) joints and (20,) confidence within the limit at ``time_ns``."""
        seconds = (time_ns - self._time_ns) * 1e-9
        last, self._time_ns = self._last, time_ns
        if last is None or not 0.0 < seconds < _MAX_GAP_S:
            self._last, self._waited[:] = joints, 0.0
            return joints, confidence
        allowed = _MAX_JOINT_SPEED_M_S * seconds
        if not _moves_too_far(joints, last, allowed):
            self._last, self._waited[:] = joints, 0.0
            return joints, confidence
        step = joints - last
        distance = np.sqrt(np.einsum("ji,ji->j", step, step))
        leaps = distance > allowed
        self._waited = np.where(leaps, self._waited + seconds, 0.0)
        waits = leaps & (self._waited <= _JUMP_HOLD_S)
        share = np.where(waits, 0.0, np.minimum(1.0, allowed / np.maximum(distance, 1e-9)))
        carried = np.zeros(3) if leaps[Joint.HIP_CENTER] else step[Joint.HIP_CENTER]
        limited = last + share[:, None] * step
        limited[waits] += carried
        self._last = limited
        return limited, confidence * share


@njit(cache=True, nogil=True)
def _moves_too_far(joints, last, allowed):
    """Returns True if any of (J, 3) joints is farther than ``allowed`` metres from its last position."""
    for j in range(len(joints)):
        x, y, z = joints[j, 0] - last[j, 0], joints[j, 1] - last[j, 1], joints[j, 2] - last[j, 2]
        if np.sqrt(x * x + y * y + z * z) > allowed:
            return True
    return False
