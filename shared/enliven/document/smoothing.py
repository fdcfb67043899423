"""Smooths takes when they are played. The recording stays unchanged."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document.clip import Clip
from enliven.document.graph.stream import PoseStream
from enliven.rotation import normalized

T = TypeVar("T", bound=Clip | PoseStream)
_CACHED_TAKES = 64
"""Number of smoothed takes in the cache. It is enough for several characters while a slider is dragged."""


def smooth_take(take: T, seconds: float) -> T:
    """Returns a take smoothed by a Gaussian filter over time. The result is cached by take and seconds.

    Args:
        seconds: the standard deviation of the Gaussian filter. 0 returns the take itself.
    """
    return take if seconds <= 0.0 else _compute_smooth_take(take, seconds)


@lru_cache(maxsize=_CACHED_TAKES)
def _compute_smooth_take(take: Any, seconds: float) -> Any:
    from scipy.ndimage import gaussian_filter1d  # Imported here, because SciPy is slow to load.

    frames = seconds / take.step

    def mixed(rows: AnyArray) -> Float:
        return np.asarray(gaussian_filter1d(np.asarray(rows, np.float64), frames, axis=0, mode="nearest"))

    if isinstance(take, PoseStream):
        return replace(take, linear=mixed(take.linear), positions=mixed(take.positions))
    # Each rotation has two quaternions, q and -q. Choose the one that is nearer to the previous frame.
    signs = np.where(np.sum(take.turns[1:] * take.turns[:-1], axis=2) < 0.0, -1.0, 1.0)
    accumulated_signs = np.concatenate([np.ones((1, signs.shape[1])), np.cumprod(signs, axis=0)])
    even = replace(take, turns=take.turns * accumulated_signs[..., None]).map_values(mixed)
    return replace(even, turns=normalized(even.turns))
