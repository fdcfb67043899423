"""Sounds that are performed along: what a project keeps of them, and what is heard of several."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Int16
from enliven.errors import InputError

SOUND_RATE = 32_000
"""Samples a second of sounds: what is performed along is recognised by half, and this halves a project."""


@dataclass(frozen=True, eq=False)
class Sound:
    """A sound that is performed along, and that films of the project have.

    Attributes:
        id: its name.
        samples: (N,) int16, one channel of :data:`SOUND_RATE`.
        begin: seconds of the project's time.
    """

    id: str
    samples: Int16
    begin: float = 0.0

    def __post_init__(self) -> None:
        if self.samples.ndim != 1 or self.samples.dtype != np.int16 or not 0.0 <= self.begin < float("inf"):
            mend = "Give samples of 16 bits, one channel, and a begin from 0 on."
            raise InputError("it is no sound", where=f"sound {self.id!r}", mend=mend)

    @property
    def end(self) -> float:
        """Seconds of the project's time."""
        return self.begin + len(self.samples) / SOUND_RATE


_LOUDEST = 32767
"""The largest sample of 16 bits."""


def mixed(sounds: Iterable[Sound], first: int, count: int) -> Int16:
    """(count,) what is heard of all sounds together from a sample of the project's time on."""
    heard = np.zeros(count, np.int32)
    for one in sounds:
        begin = round(one.begin * SOUND_RATE)
        low, high = max(first, begin), min(first + count, begin + len(one.samples))
        if low < high:
            heard[low - first : high - first] += one.samples[low - begin : high - begin]
    return np.clip(heard, -_LOUDEST - 1, _LOUDEST).astype(np.int16)


def heard_from(sounds: Iterable[Sound], second: float) -> Int16:
    """(N,) what is heard of all sounds together from a second of the project to the end of the last."""
    known = tuple(sounds)
    first, last = round(second * SOUND_RATE), round(max((one.end for one in known), default=0.0) * SOUND_RATE)
    return mixed(known, first, max(last - first, 0))
