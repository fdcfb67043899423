"""Resamples and trims clips."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Clip, Skeleton
from enliven.rotation import remove_sign_jumps, slerp


def resample_clip(clip: Clip, step: float) -> Clip:
    """Resamples a clip to frames ``step`` seconds apart. The last frame is at or before the clip's end."""
    times: Float = np.arange(len(clip.turns), dtype=np.float64) * clip.step
    tracks: dict[str, Any] = {name: _interpolate_track(track, times, step) for name, track in clip.tracks}
    if clip.mirrors is not None:
        tracks["mirrors"] = np.where(_interpolate_track(clip.mirrors, times, step) < 0.0, -1.0, 1.0)
    return replace(evenly_sampled_clip(clip.id, clip.skeleton, times, clip.turns, clip.root, step), **tracks)


def trim_clip(clip: Clip, start: float, stop: float) -> Clip:
    """Trims a clip to the frames from ``start`` to ``stop`` seconds. At least one frame is kept."""
    first = min(max(round(start / clip.step), 0), len(clip.turns) - 1)
    last = max(round(stop / clip.step) + 1, first + 1)
    trimmed = clip.map_values(lambda track: track[first:last])
    if clip.fine is None:
        return trimmed
    return replace(
        trimmed, fine=clip.fine.cut(first * clip.step, (len(trimmed.turns) + first - 1) * clip.step)
    )


def evenly_sampled_clip(
    id: str, skeleton: Skeleton, times: Float, turns: Float, root: Float, step: float
) -> Clip:
    """Builds a clip with frames ``step`` seconds apart by interpolating rotations and root at ``times`` (F,),
    which begin at 0.
    """
    before, after, fraction = _frame_fractions(times, step)
    even_turns = slerp(turns[before], turns[after], fraction[:, None])
    return Clip(id, skeleton, remove_sign_jumps(even_turns), _interpolate_track(root, times, step), step)


def _interpolate_track(track: Float, times: Float, step: float) -> Float:
    """Resamples a track (F, ...) with ``times`` (F,) to G frames ``step`` seconds apart. Returns (G, ...)."""
    before, after, fraction = _frame_fractions(times, step)
    fraction = fraction.reshape(-1, *(1,) * (track.ndim - 1))
    return np.asarray(track[before] + fraction * (track[after] - track[before]))


def _frame_fractions(times: Float, step: float) -> tuple[Int, Int, Float]:
    """Returns, for G times that are ``step`` seconds apart, the frames before and after them (G,), and the
    interpolation factors (G,).
    """
    count = int(np.floor(times[-1] / step + 1e-6)) + 1
    sample_times = np.minimum(np.arange(count) * step, times[-1])
    before = np.clip(np.searchsorted(times, sample_times, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(before + 1, len(times) - 1)
    width = np.where(after > before, times[after] - times[before], 1.0)
    return before, after, (sample_times - times[before]) / width
