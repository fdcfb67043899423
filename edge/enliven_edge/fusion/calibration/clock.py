"""Estimates the clock offset of two sensors roughly, from signals that are invariant under rigid motion.

Distances between joints and the speed of the hips are the same in every frame of reference. They also stay
the same if left and right are confused. The lag with the best correlation of two such signals is the clock
offset. If a walk repeats itself, there are several such lags, and geometry decides between them.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate

from enliven.arrays import Float
from enliven.person import Joint
from enliven_edge.fusion.calibration.tracks import BodyTrack
from enliven_edge.fusion.settings import MAX_TRACK_GAP_S, CalibrationSettings

_SAMPLE_RATE_HZ = 50.0
"""Sampling rate of the signals in hertz: above every sensor's frame rate."""
_MAX_CANDIDATES = 5
"""Number of lags that are tried. The correlation of a repetitive walk has a few peaks of equal height."""
_MIN_PEAK_DISTANCE_S = 0.15
"""Minimum distance of two peaks in seconds. Closer peaks count as the same peak."""
_SPEED_WINDOW_S = 0.12
"""Seconds over which speeds are computed. It is long enough to suppress the noise of the joints."""


def find_likely_lags(
    a: BodyTrack, b: BodyTrack, settings: CalibrationSettings, known: float | None
) -> list[float]:
    """Returns seconds to add to times of ``b`` to get times of ``a``, the likeliest first.

    Args:
        a, b: the tracks.
        settings: the settings.
        known: the lag in seconds according to synchronised clocks, or None if they are not synchronised. It
            is also tried if the tracks overlap with this lag.
    """
    signal_a, seen_a = _compute_signals(a)
    signal_b, seen_b = _compute_signals(b)
    score, common_samples = _correlate(signal_a, seen_a, signal_b, seen_b)
    lags = (np.arange(len(score)) - (len(signal_b) - 1)) / _SAMPLE_RATE_HZ + a.times[0] - b.times[0]
    score = np.where(common_samples >= settings.overlap * _SAMPLE_RATE_HZ, score, -np.inf)
    candidates = [] if known is None or not _overlap_range(a, b, known, settings) else [known]
    while len(candidates) < _MAX_CANDIDATES and np.isfinite(score).any():
        best = int(np.argmax(score))
        candidates.append(float(lags[best]))
        score = np.where(np.abs(lags - lags[best]) < _MIN_PEAK_DISTANCE_S, -np.inf, score)
    return candidates


def _overlap_range(a: BodyTrack, b: BodyTrack, lag: float, settings: CalibrationSettings) -> bool:
    start, stop = max(a.times[0], b.times[0] + lag), min(a.times[-1], b.times[-1] + lag)
    return bool(stop - start >= settings.overlap)


def _compute_signals(track: BodyTrack) -> tuple[Float, Float]:
    """Resamples a person's motion to the common rate.

    Returns (N, 4) standardised signals, 0 where the person is not visible, and (N,) whether the person is
    visible.
    """
    times = np.arange(track.times[0], track.times[-1], 1.0 / _SAMPLE_RATE_HZ)
    joints, _, confidence = track.interpolate(times, MAX_TRACK_GAP_S)
    past_joints, _, seen_before = track.interpolate(times - _SPEED_WINDOW_S, MAX_TRACK_GAP_S)
    hips = joints[:, Joint.HIP_CENTER] - past_joints[:, Joint.HIP_CENTER]
    distances = [
        np.linalg.norm(joints[:, left] - joints[:, right], axis=1)
        for left, right in (
            (Joint.WRIST_LEFT, Joint.WRIST_RIGHT),
            (Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT),
        )
    ]
    arm_reach = (
        0.5 * (joints[:, Joint.WRIST_LEFT] + joints[:, Joint.WRIST_RIGHT]) - joints[:, Joint.HIP_CENTER]
    )
    values = np.stack([np.linalg.norm(hips, axis=1), *distances, np.linalg.norm(arm_reach, axis=1)], 1)
    seen = (confidence.max(1) > 0) & (seen_before.max(1) > 0)
    if not seen.any():
        return np.zeros_like(values), np.zeros(len(values))
    values = values - values[seen].mean(0)
    # Limit the scale: a signal that hardly changes is noise, and must not be amplified to the size of the
    # other signals.
    values /= np.maximum(values[seen].std(0), 0.02)
    return np.asarray(np.clip(values, -4, 4) * seen[:, None]), seen.astype(float)


def _correlate(a: Float, seen_a: Float, b: Float, seen_b: Float) -> tuple[Float, Float]:
    """Returns (L,) the normalised correlation and (L,) the number of common samples at each of L lags."""
    if not len(a) or not len(b):
        return np.zeros(0), np.zeros(0)
    product = sum(correlate(a[:, k], b[:, k], method="fft") for k in range(a.shape[1]))
    power_a = correlate((a**2).sum(1), seen_b, method="fft")
    power_b = correlate(seen_a, (b**2).sum(1), method="fft")
    common_samples = np.asarray(correlate(seen_a, seen_b, method="fft"))
    return np.asarray(product / np.sqrt(np.maximum(power_a * power_b, 1e-6))), common_samples
