"""Resamples poses with the sensor's timestamps to constant time steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, Pose, PoseStream
from enliven.errors import InputError

_MAX_PLACES = 1 << 23
"""Maximum number of resampled poses times transforms: 0.8 GB, or 2.6 h of 30 nodes at 30 poses per second."""


def stream_at_even_steps(character: Character, poses: Sequence[Pose], stream_id: str) -> PoseStream:
    """Returns the stream of a character's poses at constant time steps, interpolated linearly.

    Raises:
        InputError: if there are too few poses, or their times are too far apart.
    """
    begin = poses[0].time_ns if poses else 0
    linear, positions, grid = resample_evenly(character, poses, begin)
    return PoseStream(stream_id, linear, positions, float(grid[1] - grid[0]))


def resample_evenly(character: Character, poses: Sequence[Pose], begin: int) -> tuple[Float, Float, Float]:
    """Interpolates poses linearly at times with constant steps.

    Returns:
        Linear parts (G, N, 3, 3) and positions (G, N, 3) of the transforms, metres, and their times (G,) in
        seconds since ``begin`` (ns).

    Raises:
        InputError: if there are too few poses, or their times are too far apart.
    """
    used_poses, seconds, grid = even_times(character, poses, begin)
    values = ([pose.linear for pose in used_poses], [pose.positions for pose in used_poses])
    linear, positions = (interpolate_linearly(np.array(each, np.float64), seconds, grid) for each in values)
    return linear, positions, grid


def even_times(character: Character, poses: Sequence[Pose], begin: int) -> tuple[list[Pose], Float, Float]:
    """Removes poses with equal times, and chooses times with constant steps.

    Returns:
        The remaining poses, their times (F,) in seconds since ``begin`` (ns), and the chosen times (G,) in
        seconds.

    Raises:
        InputError: if there are too few poses, or their times are too far apart.
    """
    location = f"character {character.id!r}"
    seconds = np.array([(pose.time_ns - begin) / 1e9 for pose in poses])
    _, first = np.unique(seconds, return_index=True)
    seconds = seconds[first]
    if len(first) < 2:
        raise InputError(
            "all recorded poses of the character have the same time",
            where=location,
            remedy="Record the take again.",
        )
    step, lasts = float(np.median(np.diff(seconds))), float(seconds[-1] - seconds[0])
    if lasts / step * len(character.pivots) > _MAX_PLACES:
        problem = f"the recording has too many poses: {lasts:.3g} s at steps of {step:.3g} s"
        raise InputError(problem, where=location, remedy="Record a shorter take.")
    return [poses[i] for i in first], seconds, np.arange(seconds[0], seconds[-1] + 0.5 * step, step)


def interpolate_linearly(values: Float, seconds: Float, grid: Float) -> Float:
    """Interpolates ``values`` (F, ...) linearly from times ``seconds`` (F,) to ``grid`` (G,). Returns (G,
    ...)."""
    previous = np.clip(np.searchsorted(seconds, grid, side="right") - 1, 0, len(seconds) - 2)
    fraction = np.clip((grid - seconds[previous]) / (seconds[previous + 1] - seconds[previous]), 0.0, 1.0)
    fraction = fraction.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - fraction) * values[previous] + fraction * values[previous + 1])
