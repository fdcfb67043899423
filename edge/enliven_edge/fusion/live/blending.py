"""Compiled blending of one joint from several sensors, without jumps when sensors appear, disappear or fail.

Every sensor s reports x_s for a joint with the weight w_s. The weighted mean m jumps when weights change. So
every sensor has an offset d_s, a low-pass of x_s - m. The joint is

    f = sum_s w_s (x_s - d_s) / sum_s w_s.

While the weights stay constant, sum w d = 0 and f = m, without any lag. When a sensor stops sending, the
result continues from the last f, because of the offsets of the other sensors. Their offsets then decay with
the time constant of the low-pass.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit

_OUTLIER_DISTANCE_M = 0.1
"""Distance in metres from a joint's prediction. A sensor that is farther away and disagrees with the others
gets a lower weight."""
_HALVING_DISTANCE_M = 0.12
"""Disagreement between sensors in metres that halves a joint's confidence."""
_FULL_WEIGHT_FRACTION = 0.3
"""Minimum fraction of the total weight for which a sensor's own confidence counts fully."""


@njit(cache=True, nogil=True)
def blend(x, w, predicted, known, before, d, share, out):
    """Computes ``out`` (20, D) from the values of S sensors.

    Args:
        x, w: (S, 20, D) values and (S, 20) weights. A weight is 0 if a sensor has no value.
        predicted, known: (20, D) the predicted values, and whether they are valid.
        before: (S, 20) whether the sensor had a value last time; updated in place.
        d: (S, 20, D) offsets; updated in place.
        share: weight of the new value in the low-pass, in [0, 1].
        out: (20, D) receives the result.
    """
    count, joints, width = x.shape
    for j in range(joints):
        # Compute the total weight, and the weight of the sensors that also had a value last time.
        total, old = 0.0, 0.0
        for s in range(count):
            total += w[s, j]
            if before[s, j]:
                old += w[s, j]
        if total <= 0.0:
            for k in range(width):
                out[j, k] = predicted[j, k]
            for s in range(count):
                before[s, j] = False
            continue
        for k in range(width):
            # Compute the weighted mean of all sensors. ``base`` is the mean of only the sensors that also had
            # a value last time, without their offsets: it continues the last result without a jump.
            mean, base = 0.0, 0.0
            for s in range(count):
                mean += w[s, j] * x[s, j, k]
                if before[s, j]:
                    base += w[s, j] * (x[s, j, k] - d[s, j, k])
            mean /= total
            if old > 0.0:
                base /= old
            else:
                base = predicted[j, k] if known else mean
            # A new sensor starts with its offset from ``base``, so that the result does not jump.
            corrected_sum = 0.0
            for s in range(count):
                if w[s, j] > 0.0 and not before[s, j]:
                    d[s, j, k] = x[s, j, k] - base
                corrected_sum += w[s, j] * (x[s, j, k] - d[s, j, k])
            out[j, k] = corrected_sum / total
            for s in range(count):
                if w[s, j] > 0.0:
                    d[s, j, k] += share * (x[s, j, k] - mean - d[s, j, k])
        for s in range(count):
            before[s, j] = w[s, j] > 0.0


@njit(cache=True, nogil=True)
def doubt_outliers(x, w, predicted):
    """Lowers the weights (S, 20) of sensors that are farther from the prediction (20, 3) than others."""
    count, joints, _ = x.shape
    for j in range(joints):
        least, speakers = np.inf, 0
        for s in range(count):
            if w[s, j] > 0.0:
                speakers += 1
                least = min(least, _squared_distance(x[s, j], predicted[j]))
        if speakers < 2:
            continue
        for s in range(count):
            if w[s, j] > 0.0:
                own = _squared_distance(x[s, j], predicted[j])
                w[s, j] *= (least + _OUTLIER_DISTANCE_M**2) / (own + _OUTLIER_DISTANCE_M**2)


@njit(cache=True, nogil=True)
def fuse_confidence(x, w, told, joints, out):
    """Computes (20,) the confidence of fused joints from the agreement of S sensors.

    Args:
        x: (S, 20, 3) metres.
        w, told: (S, 20) weights, 0 if a sensor has no value, and (S, 20) each sensor's own confidence.
        joints: (20, 3) the fused joints.
        out: (20,) receives the result.
    """
    for j in range(len(out)):
        total, mean, best, spread = 0.0, 0.0, 0.0, 0.0
        for s in range(len(x)):
            total += w[s, j]
        if total <= 0.0:
            out[j] = 0.0
            continue
        for s in range(len(x)):
            share = w[s, j] / total
            mean += share * told[s, j]
            spread += share * _squared_distance(x[s, j], joints[j])
            if share > _FULL_WEIGHT_FRACTION:
                best = max(best, told[s, j])
        out[j] = max(mean, best) / (1.0 + spread / _HALVING_DISTANCE_M**2)


@njit(cache=True, nogil=True)
def bones_within(joints, bones, shortest, longest):
    """Returns True if the length of every bone (B, 2) is between the given limits (B,) in metres."""
    for b in range(len(bones)):
        squared = _squared_distance(joints[bones[b, 0]], joints[bones[b, 1]])
        if not shortest[b] ** 2 < squared < longest[b] ** 2:
            return False
    return True


@njit(cache=True, nogil=True)
def _squared_distance(a, b):
    """Returns the squared distance of two points."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@njit(cache=True, nogil=True)
def trunk_distances(a, a_sure, b, b_sure, pairs, out):
    """Writes (A, B) mean distances between bodies in metres into ``out``.

    It uses 12 midpoints that do not change if left and right are exchanged.

    Args:
        a, b: (A, 20, 3) and (B, 20, 3) joints in metres. a_sure, b_sure: (A, 20) and (B, 20) confidence.
        pairs: (12, 2) the two joints of each point.
        out: (A, B) receives the result.
    """
    for m in range(len(a)):
        for n in range(len(b)):
            total, weight = 0.0, 0.0
            for p in range(len(pairs)):
                i, j = pairs[p, 0], pairs[p, 1]
                sure = min(a_sure[m, i], a_sure[m, j]) * min(b_sure[n, i], b_sure[n, j]) + 1e-3
                apart = 0.0
                for k in range(3):
                    apart += (0.5 * (a[m, i, k] + a[m, j, k] - b[n, i, k] - b[n, j, k])) ** 2
                total += sure * np.sqrt(apart)
                weight += sure
            out[m, n] = total / weight


@njit(cache=True, nogil=True)
def side_costs(x, sure, expected, other):
    """Returns two mean distances in metres of the limb joints from the expected ones.

    The first is for the present sides, the second for left and right exchanged.
    """
    plain, crossed, weight = 0.0, 0.0, 0.0
    for j in range(len(other)):
        o = other[j]
        if o == j:
            continue
        w = min(sure[j], sure[o]) + 1e-3
        plain += w * min(np.sqrt(_squared_distance(x[j], expected[j])), 0.5)
        crossed += w * min(np.sqrt(_squared_distance(x[o], expected[j])), 0.5)
        weight += w
    return plain / weight, crossed / weight
