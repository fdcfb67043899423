"""Sounds that accompany a performance: their storage in a project, and mixing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Int16
from enliven.errors import InputError

SOUND_RATE = 32_000
"""Samples per second: half of this suffices to recognise the sound, and it halves a project's size."""


@dataclass(frozen=True, eq=False)
class Sound:
    """A sound that accompanies a performance, and is included in films of the project.

    Attributes:
        id: its name.
        samples: (N,) int16, one channel at :data:`SOUND_RATE`.
        begin: start in seconds of the project's time.
    """

    id: str
    samples: Int16
    begin: float = 0.0

    def __post_init__(self) -> None:
        if self.samples.ndim != 1 or self.samples.dtype != np.int16 or not 0.0 <= self.begin < float("inf"):
            mend = "Give 16-bit samples of one channel, and a begin of at least 0."
            raise InputError("it is not a valid sound", where=f"sound {self.id!r}", mend=mend)

    @property
    def end(self) -> float:
        """The end in seconds of the project's time."""
        return self.begin + len(self.samples) / SOUND_RATE


_MAX_INT16 = 32767
"""The largest sample of 16 bits."""


def mixed(sounds: Iterable[Sound], first: int, count: int) -> Int16:
    """Returns (count,) the mix of all sounds from a sample ``first`` of the project's time on."""
    heard = np.zeros(count, np.int32)
    for sound in sounds:
        begin = round(sound.begin * SOUND_RATE)
        low, high = max(first, begin), min(first + count, begin + len(sound.samples))
        if low < high:
            heard[low - first : high - first] += sound.samples[low - begin : high - begin]
    return np.clip(heard, -_MAX_INT16 - 1, _MAX_INT16).astype(np.int16)


def heard_from(sounds: Iterable[Sound], second: float) -> Int16:
    """Returns (N,) the mix of all sounds from a time in seconds of the project to the end of the last
    sound."""
    all_sounds = tuple(sounds)
    first, last = (
        round(second * SOUND_RATE),
        round(max((sound.end for sound in all_sounds), default=0.0) * SOUND_RATE),
    )
    return mixed(all_sounds, first, max(last - first, 0))
