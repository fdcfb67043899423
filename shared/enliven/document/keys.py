"""Keys: moments at which an artist says how far something is turned and moved, and curves through them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.errors import InputError

KEY_STEP = 1.0 / 30.0
"""Seconds of a frame of a take that is made from keys, on which keys lie: a frame of film."""
_LATEST = 3600.0
"""Seconds of the last key at most: an hour has 100,000 frames."""
EASES: tuple[str, ...] = ("smooth", "linear", "step")
"""How a key goes over into the next: without a jump in speed and no farther than either, straight, or at
once."""


@dataclass(frozen=True)
class MotionKey:
    """What a bone, a node or a whole character is turned and moved by at a moment.

    Attributes:
        second: of the take.
        degrees: a rotation vector, in the axes of the rest pose.
        ease: how it goes over into the next key.
        metres: how far it is moved, in the same axes; a bone is only turned.
    """

    second: float
    degrees: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ease: str = "smooth"
    metres: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("degrees", "metres"):
            object.__setattr__(self, name, tuple(float(one) for one in getattr(self, name)))
        problem = ""
        if not 0.0 <= self.second <= _LATEST or not all(map(math.isfinite, (*self.degrees, *self.metres))):
            problem = f"{self.degrees} degrees, {self.metres} m at {self.second} s cannot be played"
        elif self.ease not in EASES or len(self.degrees) != 3 or len(self.metres) != 3:
            problem = f"{self.degrees} degrees, {self.metres} m, {self.ease!r} are no key"
        if problem:
            mend = f"Give seconds from 0 on, three angles, three metres, and one of {', '.join(EASES)}."
            raise InputError(problem, where="key", mend=mend)


def placed_keys(keys: Sequence[MotionKey], where: str) -> tuple[MotionKey, ...]:
    """The keys in the order of time, each on a frame of its own.

    Raises:
        InputError: without a key, or for two on one frame.
    """
    placed = sorted(((round(key.second / KEY_STEP), key) for key in keys), key=lambda one: one[0])
    if not placed or len({frame for frame, _ in placed}) < len(placed):
        what = "two keys are on one frame" if placed else "there is no key"
        raise InputError(what, where=where, mend="Give each key a frame of its own.")
    return tuple(replace(key, second=frame * KEY_STEP) for frame, key in placed)


def key_values(keys: Sequence[MotionKey], seconds: AnyArray) -> Float:
    """(T, 6) degrees and metres at seconds (T,), as :func:`through_keys` has them."""
    values = np.array([(*key.degrees, *key.metres) for key in keys], np.float64)
    return through_keys([key.second for key in keys], values, [key.ease for key in keys], seconds)


def through_keys(at: Sequence[float], values: Float, eases: Sequence[str], seconds: AnyArray) -> Float:
    """(T, C) values at seconds (T,), of channels through values (K, C) at seconds ``at`` (K,).

    Before the first key they are as there, and after the last. Smooth pieces are cubic, with the slopes of
    Fritsch and Carlson (1980), which go beyond neither key.
    """
    times = np.asarray(at, np.float64)
    seconds = np.clip(np.asarray(seconds, np.float64), times[0], times[-1])
    if len(times) == 1:
        return np.repeat(values, len(seconds), axis=0)
    # A frame that lies on a key by rounding is on it.
    left = np.clip(np.searchsorted(times, seconds + 1e-9, side="right") - 1, 0, len(times) - 2)
    wide = np.diff(times)[:, None]
    slopes = _slopes(wide, np.diff(values, axis=0) / wide)
    u = np.clip((seconds - times[left]) / wide[left, 0], 0.0, 1.0)[:, None]
    ease = np.array(eases)[left][:, None]
    one, other, span = values[left], values[left + 1], wide[left]
    cubic = (
        (2 * u**3 - 3 * u**2 + 1) * one
        + (u**3 - 2 * u**2 + u) * span * slopes[left]
        + (3 * u**2 - 2 * u**3) * other
        + (u**3 - u**2) * span * slopes[left + 1]
    )
    step = np.where(u < 1.0, one, other)
    return np.select([ease == "smooth", ease == "linear"], [cubic, one + u * (other - one)], step)


def _slopes(wide: Float, steep: Float) -> Float:
    """(K, 3) slopes at K keys for pieces (K - 1, 1) seconds wide that are (K - 1, C) steep; 0 at the ends,
    and where a channel turns back."""
    before, after = steep[:-1], steep[1:]
    first, second = 2 * wide[1:] + wide[:-1], wide[1:] + 2 * wide[:-1]
    on = before * after > 0.0
    mean = (first + second) / (first / np.where(on, before, 1.0) + second / np.where(on, after, 1.0))
    ends = np.zeros((1, steep.shape[1]))
    return np.concatenate([ends, np.where(on, mean, 0.0), ends])
