"""Key reduction of an animation: keeps the keys needed for a tolerance under linear interpolation."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import njit


def reduce_keys(values: Float, tolerance: float, turns: bool = False, times: Float | None = None) -> Int:
    """Returns the frames (K,) of ``values`` (T, C) to keep, including the first and the last.

    Between two kept keys every frame is within the tolerance of the interpolated value. The search is greedy:
    each key is as far as possible from the previous key, without backtracking.

    Args:
        turns: True for unit quaternions without sign jumps, which players interpolate on the sphere (slerp).
            The tolerance is then in radians.
        times: (T,) seconds of the frames. None for evenly spaced frames.
    """
    if len(values) <= 2 or tolerance <= 0.0:
        return np.arange(len(values))
    when = np.arange(float(len(values))) if times is None else np.ascontiguousarray(times, np.float64)
    return np.asarray(_needed_keys(np.ascontiguousarray(values, np.float64), when, tolerance, turns))


@njit(cache=True, nogil=True)
def _needed_keys(values, times, tolerance, turns):
    kept = np.empty(len(values), np.int64)
    kept[0], count = 0, 1
    # Read the zero from the array. A literal 0 has a different Numba type, so _is_within_tolerance would be
    # compiled a second time.
    begin = kept[0]
    last = len(values) - 1
    while begin < last:
        # Double the step while all frames stay within the tolerance, then bisect.
        good, step = begin + 1, 2
        while begin + step <= last and _is_within_tolerance(
            values, times, begin, begin + step, tolerance, turns
        ):
            good, step = begin + step, 2 * step
        bad = min(begin + step, last + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            if _is_within_tolerance(values, times, begin, middle, tolerance, turns):
                good = middle
            else:
                bad = middle
        kept[count], count, begin = good, count + 1, good
    return kept[:count]


@njit(cache=True, nogil=True)
def _is_within_tolerance(values, times, begin, end, tolerance, turns):
    """Returns True if all frames between two keys are within the tolerance of their interpolation."""
    width = values.shape[1]
    dot = 0.0
    for c in range(width):
        dot += values[begin, c] * values[end, c]
    sign = -1.0 if turns and dot < 0.0 else 1.0
    angle = np.arccos(min(abs(dot), 1.0)) if turns else 0.0
    for f in range(begin + 1, end):
        share = (times[f] - times[begin]) / (times[end] - times[begin])
        first, second = 1.0 - share, share
        if turns and angle > 1e-4:
            first, second = np.sin(first * angle) / np.sin(angle), np.sin(second * angle) / np.sin(angle)
        off, same = 0.0, 0.0
        for c in range(width):
            shown = first * values[begin, c] + sign * second * values[end, c]
            off += (shown - values[f, c]) ** 2
            same += (shown + values[f, c]) ** 2
        if turns:
            # For small angles, the distance of two quaternions is half of the rotation angle between them.
            off = 4.0 * min(off, same)
        if off > tolerance * tolerance:
            return False
    return True
