"""Sounds that accompany a performance: the data type in a project, and mixing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Int16
from enliven.errors import InputError

SOUND_RATE = 32_000
"""Sampling rate in samples per second. It is lower than the rate of music files, which keeps projects small,
and the sound is still clear.
"""


@dataclass(frozen=True, eq=False)
class Sound:
    """A sound that accompanies a performance, and is included in films of the project.

    Attributes:
        id: name of the sound.
        samples: (N,) int16, one channel at :data:`SOUND_RATE`.
        begin: start time in seconds of the project.
    """

    id: str
    samples: Int16
    begin: float = 0.0

    def __post_init__(self) -> None:
        if self.samples.ndim != 1 or self.samples.dtype != np.int16 or not 0.0 <= self.begin < float("inf"):
            remedy = "Pass 16-bit mono samples and a start time of at least 0 s."
            raise InputError(
                "the samples or the start time of the sound are not valid",
                where=f"sound {self.id!r}",
                remedy=remedy,
            )

    @property
    def end(self) -> float:
        """The end time in seconds of the project."""
        return self.begin + len(self.samples) / SOUND_RATE


_MAX_INT16 = 32767
"""The largest 16-bit sample."""


def mix_sounds(sounds: Iterable[Sound], first: int, count: int) -> Int16:
    """Returns the mix (count,) of all sounds, starting at sample index ``first`` of the project's time."""
    total = np.zeros(count, np.int32)
    for sound in sounds:
        begin = round(sound.begin * SOUND_RATE)
        low, high = max(first, begin), min(first + count, begin + len(sound.samples))
        if low < high:
            total[low - first : high - first] += sound.samples[low - begin : high - begin]
    return np.clip(total, -_MAX_INT16 - 1, _MAX_INT16).astype(np.int16)


def mix_from(sounds: Iterable[Sound], second: float) -> Int16:
    """Returns the mix (N,) of all sounds from ``second``, in seconds of the project, to the end of the last
    sound.
    """
    all_sounds = tuple(sounds)
    first, last = (
        round(second * SOUND_RATE),
        round(max((sound.end for sound in all_sounds), default=0.0) * SOUND_RATE),
    )
    return mix_sounds(all_sounds, first, max(last - first, 0))
